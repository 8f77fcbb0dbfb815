"""Whether intervals hold. Read `responses`, `linear`, `report`; the settings say which robots there are."""
