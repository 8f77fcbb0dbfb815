"""Rigid dynamics and friction by inverse-dynamics least squares.

Read `fitting` from above; then `shots`, `rows`, `regression` and `residuals`, last `conclusion`.
"""
