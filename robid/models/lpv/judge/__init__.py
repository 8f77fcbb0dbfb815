"""What a position-dependent model is worth. Read `validating`, then `grading`."""
