"""Paper 3: contact twin, identification, adversarial adaptation; source and drawing: README.md."""
