"""What an elastic model is worth. Read `validating`, `measures`, `assessment` with `grading`, `plausible`, `causes`."""
