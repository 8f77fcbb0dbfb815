"""Transfer functions from commands to positions. Read `options`, `data`, `channels`, `transfer`, then `fitting`."""
