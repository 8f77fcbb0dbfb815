"""Elastic fits. Read `options`, `parameters`, `problem`, `fitting`, `strategy`, then `uncertainty` and `result`."""
