"""The study of mistakes. Read `responses`, `cases`, `report`; `units` reads logs in wrong units."""
