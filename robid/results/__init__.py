"""What every result has, whatever its kind: read `estimate`, `grade`, `doubt`, `outcome`, then `plausible/`."""
