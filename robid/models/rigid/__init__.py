"""Rigid models: inertias, first moments, friction and offsets from records.

Read `settings`, `fit/`, `judge/`, then `family`, and what goes out: `page`, `files`.
"""
