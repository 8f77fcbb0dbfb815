"""The study of estimators of responses. Read `study`, `report`."""
