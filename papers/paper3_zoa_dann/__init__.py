"""Paper 3: contact twin, identification, adversarial adaptation.

recordings (no labels) --> identify --> contact twin --> labelled windows --> DANN --> accuracy on other recordings

Used in: Paper 3, dynamics-assisted unsupervised domain adaptation for rolling bearing fault diagnosis, Journal of
Vibration and Control, DOI 10.1177/10775463261462852.
"""
