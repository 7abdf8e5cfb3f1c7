"""Study of the frozen scenarios of pdm-bench: recordings that teach, and recordings that are judged."""
