"""What of an external fit stands on the page, in the terminal and in the summary."""
