"""Choice of configurations.

Read `options`, `information`, then where information comes from: `candidates` (assumed), `measured`, `visits`; then how
weights are found: `criteria`, `relaxed`, `interior`; and whole numbers of experiments: `plan`.
"""
