"""What a rigid fit is worth. Read `scales` (before it), `plausible`, then `validating`."""
