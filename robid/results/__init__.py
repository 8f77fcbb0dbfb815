"""What every result has, whatever its kind: read `estimate`, `grade`, `finding`, `outcome`, then `plausible/`."""
