"""The robot. Read `description`, `parameters`, `model`, `linearize`, `response`, then `export` and `foreign`."""
