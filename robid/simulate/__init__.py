"""The simulated experiment. Read `options`, `experiment`, `controller`, `engine`, `truth`."""
