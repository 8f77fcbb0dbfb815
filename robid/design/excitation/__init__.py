"""Excitation. Read `options`, `lines`, `excitation`, then `loop` and `prediction`; `pose_chirp` moves the tool."""
