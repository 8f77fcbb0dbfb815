"""Signals. Read `record`, `quantities`, `multisine`, `friction`."""
