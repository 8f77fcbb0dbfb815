"""Robust regression, as of Janot et al. (2009). Read `seeded`, then the parts: `haptic`, `branch`, `recorded`."""
