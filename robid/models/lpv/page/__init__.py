"""What of a position-dependent fit stands on the page, in the terminal and in the summary."""
