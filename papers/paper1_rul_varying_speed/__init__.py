"""Paper 1: remaining life under varying speed, from simulated run-to-failure records (see README.md)."""
