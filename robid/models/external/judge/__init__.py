"""What transfer functions are worth. Read `prediction`, then `validating` and `grading`."""
