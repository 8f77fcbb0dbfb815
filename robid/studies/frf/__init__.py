"""The study of estimators of responses."""
