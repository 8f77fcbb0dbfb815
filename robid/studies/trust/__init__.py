"""Whether intervals hold. Read `responses`, `linear`, `figures`, `report`; the settings say which robots there are."""
