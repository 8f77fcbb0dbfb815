"""Elastic fits.

Read `options`, `parameters`, `rest_model`, `weights`, `problem`, `optimizers`, `fitting`; then how far a result may be
trusted: `uncertainty`, `model_error`, `nuisance/`, `physical`, `intervals`; and `result`, which makes a `solution`.
"""
