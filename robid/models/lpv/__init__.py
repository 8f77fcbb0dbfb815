"""Position-dependent models: one sparse state-space model from responses at several positions.

Read `settings`, `fit/`, `judge`, then `family`, and what goes out: `page`, `files`.
"""
