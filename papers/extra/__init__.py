"""Studies that answer a question of this project rather than one of the papers."""
