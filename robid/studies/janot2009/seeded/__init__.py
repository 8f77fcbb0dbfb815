"""Machines of known parameters over many seeds. Read `identification`, `chunks`, `figures`."""
