"""The inverse-dynamics regressor.

Read `links`, `drives`, `model`, `base`, then `forward`.
"""
