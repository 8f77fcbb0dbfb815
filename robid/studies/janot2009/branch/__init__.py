"""A branch of a haptic interface with a parallelogram. Read `motion`, `rig`, `runs`, `page`."""
