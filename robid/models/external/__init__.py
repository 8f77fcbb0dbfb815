"""External models: transfer functions from commands to positions.

Read `settings`, `fit/`, `judge/`, then `family`, and what goes out: `page/`, `files`.
"""
