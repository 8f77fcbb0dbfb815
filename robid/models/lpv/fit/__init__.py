"""Linear models whose dynamics change with position, from frequency responses at rest.

Read `fitting` and `options` from above; then `state_space`, `model` and `responses`; `local`; `sparse` and
`path`; last `uncertainty` and `solution`.
"""
