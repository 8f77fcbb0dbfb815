"""Logs in wrong units, read by a fit of any family. Read `logs`, `scales`, `cases`, `figures`."""
