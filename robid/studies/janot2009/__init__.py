"""The study of robust regression. Read `haptic`, the one-axis device, then `haptic_runs`."""
