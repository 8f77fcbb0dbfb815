"""Kinds of models, one room each. Read `family` for what one is, `known` for which there are, then `elastic/`."""
