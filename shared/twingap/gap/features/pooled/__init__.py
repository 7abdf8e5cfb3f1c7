"""Features of several records together."""
