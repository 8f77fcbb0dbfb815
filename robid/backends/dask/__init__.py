"""Tasks on a Dask cluster. Read `cluster` (our own, or a scheduler, and the map over it), `exchange`, `worker`."""
