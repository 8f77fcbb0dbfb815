"""What a model is worth. Read `elastic`, `measures`, `assessment` with `grade`, `plausible`, `causes`."""
