"""The study of configurations of Zimmermann et al. (2023). Read `study`, `models`, `steps`, `figures`, `report`."""
