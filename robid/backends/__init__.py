"""Where tasks run: `map`, in this process or in several, or on a cluster through `dask`."""
