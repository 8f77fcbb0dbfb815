"""What of a rigid fit stands on the page, in the terminal and in the summary. Read `report`, then `charts`."""
