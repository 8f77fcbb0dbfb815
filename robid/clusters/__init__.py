"""Statistics of what several places say of the same parameters.

A place is a robot configuration with all that was measured in it. Read `evidence`, then `pooling`.
"""
