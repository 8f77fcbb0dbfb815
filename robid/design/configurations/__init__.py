"""Choice of configurations.

Read `options`, `information`, then where information comes from: `candidates` (assumed), `measured`, `fitted`; then how
weights are found: `criteria`, `relaxed`, `interior`; and whole experiments: `plan`, `exchange`, `stability`.
"""
