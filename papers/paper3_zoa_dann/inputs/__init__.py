"""A plain network with and without adaptation, on several inputs: what an input is worth in the paper's frame."""
