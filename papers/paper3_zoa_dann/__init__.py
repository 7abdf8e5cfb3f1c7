"""Paper 3: contact twin, identification, adversarial adaptation (see README.md)."""
