"""Rigid robots whose files are rough: what fits to sound logs are worth, what is said of them, and the cut-off."""
