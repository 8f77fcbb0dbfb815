"""An arm of six axes, simulated many times. Read `runs`, then `page`."""
