"""What the study section of an experiment file says. Read `study` first, which lists them."""
