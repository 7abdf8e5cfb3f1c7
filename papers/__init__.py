"""The three papers, each a folder with only what is its own."""
