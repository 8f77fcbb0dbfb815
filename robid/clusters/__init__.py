"""Statistics of what several clusters say of the same parameters.

A cluster is a robot configuration with all that was measured in it. Read `evidence`, then `pooling`.
"""
