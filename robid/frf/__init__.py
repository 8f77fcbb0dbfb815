"""Frequency responses: `frf`, `estimate`, `reading`, `blocks`, `local`, `covariance`; `compensation`, `silent`."""
