"""Faults among many logged robots, and the speed of `robid reprocess`. Read `logs`, then `reprocessed`."""
