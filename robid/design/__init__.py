"""Design of excitation and of the configurations to measure."""
