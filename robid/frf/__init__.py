"""Frequency responses: `frf`, `estimate`, `reading`, `blocks`, `local`, `covariance`; `compensation`, `silent`.

`extrema` finds peaks and dips of a measured response, by local models of `local_model`.
"""
