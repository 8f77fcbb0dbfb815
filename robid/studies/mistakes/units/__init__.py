"""Logs in wrong units, read by a fit of any family. Read `scales`, `logs`, `rough`, `robots`, `cases`, `figures`."""
