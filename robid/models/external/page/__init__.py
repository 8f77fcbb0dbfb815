"""What of an external fit stands on page, terminal and summary. Read `report`, `data`, then `charts`."""
