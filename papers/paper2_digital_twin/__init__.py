"""Paper 2: a digital twin that is updated, diagnosis by what is labelled, degradation (see README.md)."""
