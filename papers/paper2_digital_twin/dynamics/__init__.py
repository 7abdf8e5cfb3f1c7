"""Dynamics study: whether the contact model settles to balance, and whether faults give impacts at their rates."""
