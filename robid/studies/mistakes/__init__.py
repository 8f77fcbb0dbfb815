"""The study of mistakes.

Read `responses`, `cases`, `report`; `unit_logs` and `wrong_units` are about logs in wrong units.
"""
