"""Linear models whose dynamics change with position, from frequency responses at rest.

Read `estimation` and `options` from above; then `state_space`, `basis`, `model` and `responses`; `problem`, `subspace`,
`local`; `alignment`, `sparse_basis` and `smile`; `blocks`, `cone_program`, `penalised`, `sparse` and
`path`; last `uncertainty`.
"""
