"""The inverse-dynamics regressor.

Read `options`, `tree`, `closure`, `motion`, `links`, `drives`, `model`, then `forward`.
"""
