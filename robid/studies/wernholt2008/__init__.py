"""The study of parameter estimators of Wernholt and Moberg (2008). Read `study`, `figures`, `conclusions`, `report`."""
