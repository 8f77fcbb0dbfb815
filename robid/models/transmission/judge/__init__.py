"""What speaks against a fit of gears, and how it does on a motion that it never saw."""
