"""Transfer functions from commands to positions.

Read `fitting` and `options` from above; then `data` and `transfer`; `problem`, `reduction`, `descent`, `search`
and `output_error`; `choice` and `covariance`; last what is told of them: `etfe`, `coupling`, `checks`, `parameters`.
"""
