"""The inverse-dynamics regressor.

Read `options`, `tree`, `closure`, `motion`, `links`, `drives`, `model`, `base`, then `forward`.
"""
