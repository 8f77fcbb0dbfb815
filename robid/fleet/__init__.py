"""An experiment file over the rows of a manifest. Read `manifest`, `rows`, `ledger`, `row`, `run`, `table`."""
