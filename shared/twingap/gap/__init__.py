"""The gap between simulated and real records: where it lies, which effect causes it, how far it shrinks."""
