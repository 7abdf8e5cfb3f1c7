"""Features of the smooth spectrum and the background."""
