"""Rigid dynamics and friction by inverse-dynamics least squares.

Read `fitting` from above; then `shots`, `rows`, `preprocessing`, `reading`, `reduction`, `least_squares`, `huber`,
`instruments` and `uncertainty`, last `verdict` and `conclusion`.
"""
