"""The one-axis haptic device of the paper. Read `device`, `runs`, `page`."""
