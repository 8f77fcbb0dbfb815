"""Tasks on a Dask cluster. Read `cluster` (our own, or a scheduler), `checks`, `mapping`, `exchange`, `worker`."""
