"""Diagnosis of bearing faults from simulated records and a few labelled ones: images, networks, maps, what to use when.

pieces --scalograms--> images --inception--> network from the twin --residual_head--> corrected by labelled records
windows --condition_features--> few_labels (SVM) | severity (alarms without fault labels; a map a fault)
labelled records of each fault --choose--> which of these
"""
