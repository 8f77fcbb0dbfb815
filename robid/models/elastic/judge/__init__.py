"""What an elastic model is worth.

Read `fitted`, `grading` and `validating`; `local_model`, `extrema` and `resonances`; then what is doubted and why:
`plausible_parameters`, `ratios`, `reversals`, `causes`, and `assessment`, which puts it together.
"""
