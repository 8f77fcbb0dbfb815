"""The study of mistakes. Read `study`, `mistaken`, `responses`, `cases`, `grades`, `report`."""
