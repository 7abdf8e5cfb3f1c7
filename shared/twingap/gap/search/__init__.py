"""The search for missing effects: evidence, candidate effects, values."""
