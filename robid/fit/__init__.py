"""Fits. Read `options`, `parameters`, `problem`, `elastic`, `strategy`, then `uncertainty` and `result`."""
