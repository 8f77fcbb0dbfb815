"""What a fit of gears adds to page, terminal and summary."""
