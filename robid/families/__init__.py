"""Families of models. Read `family.py` for what one is, `known.py` for which there are, then `elastic/`."""
