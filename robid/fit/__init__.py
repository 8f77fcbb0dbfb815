"""Fits. Read `options`, `parameters`, `problem`, `elastic`, `strategy`, then what it is worth: `uncertainty`, `result`."""
