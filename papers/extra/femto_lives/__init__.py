"""Paper 1's twin of lives on FEMTO's real runs: remaining life before and after its gap is closed."""
