"""Which configurations to measure, as of Zimmermann et al. (2023). Read `models`, `steps`, `figures`, `report`."""
