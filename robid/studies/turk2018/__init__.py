"""Turk et al. (2018): position-dependent dynamics from local responses. Read `synthetic`."""
