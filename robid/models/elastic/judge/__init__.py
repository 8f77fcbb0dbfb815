"""What an elastic model is worth.

Read `fitted`, `grading` and `validating`; `extrema` and `resonances`; then the findings and why:
`plausible_parameters`, `ratios`, `reversals`, `causes`, and `assessment`, which puts it together.
"""
