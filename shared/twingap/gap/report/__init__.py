"""A diagnosis as objects, files, figures and a page."""
