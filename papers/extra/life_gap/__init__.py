"""Gap between paper 1's twin and the runs, by stage of life and speed, and the worth of the named effects."""
