"""Artifacts: what one stage hands to the next, as checked HDF5 files; the only place that knows h5py."""
