"""Parameter estimators, as of Wernholt and Moberg (2008). Read `study`, `figures`, `report`."""
