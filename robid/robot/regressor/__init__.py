"""The inverse-dynamics regressor. Read `options`, `tree`, `motion`, `links`, `drives`, `model`, then `forward`."""
