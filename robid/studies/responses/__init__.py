"""The study of fits to responses: random plants, whose order and place are to be found."""
