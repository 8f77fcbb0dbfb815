"""A fleet's estimates against each other: what a population is like, who is none of it, who changes."""
