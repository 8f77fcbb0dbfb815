"""What of a position-dependent fit stands on page, terminal and summary. Read `report`, then `charts`."""
