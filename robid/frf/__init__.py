"""Frequency responses. Read `frf`, `estimate`, `blocks`, `local`, then friction: `compensation`, `silent`, `laws`."""
