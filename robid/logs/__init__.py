"""Imports logs into records, and refuses what cannot be trusted.

Read mapping (what was said of a log), formats (its variables), columns with streams (its channels), clocks with pace
and timing (their time), period with losses and period_checks (how they repeat), resample, placing and importing;
inspection looks at a log of which nothing was said.
"""
