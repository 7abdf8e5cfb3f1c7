"""The three papers, each a folder with only what is its own; `studies` is what their studies have in common."""
