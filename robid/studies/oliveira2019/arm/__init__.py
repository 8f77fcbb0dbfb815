"""A simulated arm on a rail, seen from outside. Read `homes`, then `page`."""
