"""Elastic models: springs and dampers from frequency responses.

Read `settings`, `fit/`, `judge/`, then `family`, and what goes out: `page/`, `files`, `mechanics`.
"""
