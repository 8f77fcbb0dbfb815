"""The page of a fleet, and the pages of single rows.

Read `found`, `failures`, `outliers`, `parameters`, `report`; then `row`.
"""
