"""Robust regression, as of Janot et al. (2009).

Read `seeded` and `verdicts`, then the parts: `haptic`, `branch`, `recorded`, `kr300`.
"""
