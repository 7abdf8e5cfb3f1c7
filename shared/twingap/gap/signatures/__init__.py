"""What is measured on a record: named, dimensionless numbers, each moved by some effect and little by others."""
