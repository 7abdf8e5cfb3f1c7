"""Study of closing the gap for transfer: a network trained on paper 2's twin as printed, and with the named effects."""
