"""Metrics and tests on data that no fit saw."""
