"""What transfer functions are worth. Read `prediction`, `plausible`, then `validating`."""
