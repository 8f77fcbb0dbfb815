"""What is shown of an elastic fit: read `gather` (rows from artifacts), `resonances`, then `report`."""
