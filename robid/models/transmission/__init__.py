"""Gears between two encoders: stiffness, lost motion, hysteresis and transmission error from ordinary motions.

Read `fit.fitting` for the order of the steps, `fit.law` for the gear; docs/methods, sec. 15.
"""
