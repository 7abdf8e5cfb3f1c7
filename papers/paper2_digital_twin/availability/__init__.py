"""Diagnosis by how much fault data there is: SOM-MQE, SVM and a network from the twin, on real recordings."""
