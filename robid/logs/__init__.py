"""Vendor log files, imported into records. Read `files`, `mapping`, `importing`, then `match` and `checks`."""
