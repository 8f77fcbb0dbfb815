"""Excitation. Read `options`, `lines`, `signal_lines`, `signal` with `excitation`, then `loop`, `prediction`, `snr`."""
