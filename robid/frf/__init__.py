"""Frequency responses and their estimators."""
