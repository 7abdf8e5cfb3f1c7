"""Ablation of proposed model 3: one encoding at a time, on simulated lives and on true ones."""
