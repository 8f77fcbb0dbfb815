"""Artifacts, as checked HDF5 files; only here is h5py known. Read `artifact`, `store`, `mapping`, then one as `frf`."""
