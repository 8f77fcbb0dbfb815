"""Solutions of fits with other estimates."""

from dataclasses import replace


def with_estimate(solution, **fields):
    """The solution of an elastic fit with other fields of its estimate."""
    return replace(solution, estimate=replace(solution.estimate, **fields))
