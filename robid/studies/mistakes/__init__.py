"""The study of mistakes. Read `cases`, `report`; `unit_logs` and `wrong_units` are about logs in wrong units."""
