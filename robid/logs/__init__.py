"""Vendor log files, imported into records."""
