"""What a position-dependent model is worth, in `validating`."""
