"""Whether intervals hold. Read `individuals`, `responses`, `models`, `linear`, `figures`, `report`."""
