"""The tolerances of the tests, and the only place that holds them; loosening one needs a stated reason.

Convergence has no entry: there the slope is tested, not the size. Certified values are published figures and bring
the digits that their source prints.
"""

# Round trips, Parseval, orthogonality: relative; the absolute one is this times the signal's size.
IDENTITY = 1e-10

# Analytic truth against finite differences: relative.
FINITE_DIFFERENCE = 1e-6

# Sampled responses against exact discretisation, up to 0.45 of the sampling rate: relative to a line's largest element.
DISCRETISATION = 1e-5

# Known truth back without noise: relative.
RECOVERY = 1e-4

# Known truth back with noise, fixed seed: predicted standard deviations.
RECOVERY_SIGMA = 4.0

# Compactly stored samples: float32 rounding relative to the largest value.
COMPACT = 2.0**-24

# Response of an exported MJCF by finite differences of the simulator at a step of 1e-5 s: relative, per element.
MJCF = 1e-2
