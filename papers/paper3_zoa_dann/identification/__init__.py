"""Identification study: stiffness and damping by the zebra algorithm and by others, and their use for adaptation."""
