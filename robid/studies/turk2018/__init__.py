"""Position-dependent dynamics, as of Turk et al. (2018). Read the parts `synthetic`, `rest`, `moving`."""
