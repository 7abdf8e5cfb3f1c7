"""`twingap rul` on runs of the virtual rig (surrogate), without and with what the bench's other runs showed."""
