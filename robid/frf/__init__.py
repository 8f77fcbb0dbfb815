"""Frequency responses.

Read `frf`, `estimate`, `blocks`, `windows`, `local`, then friction: `compensation`, `silent`, `laws`.
"""
