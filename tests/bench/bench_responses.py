"""Fits to responses against SciPy's least squares with finite differences."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from robid.models.external.response.denominator import denominator_of
from robid.models.external.response.descent import descend
from robid.models.external.response.lines import make_lines
from robid.models.external.response.residual import evaluate
from robid.studies.responses.plants import draw


@pytest.mark.parametrize(("key", "kind", "seed"), [("", "mimo", 1), ("_one_element", "siso", 5)])
def test_against_finite_differences(compare, key, kind, seed):
    """One response to the same cost from the same start, all poles 2 % off and the best numerators there.

    The reference moves numerators and factors of the denominator; powers of scaled frequency serve it at these orders.
    """
    plant, data = draw(kind, seed)
    lines = make_lines(data, "continuous")
    degrees = (len(plant.poles) - 1,) * lines.n_element
    off = plant.poles / lines.reference * np.where(np.arange(len(plant.poles)) % 4 < 2, 1.02, 0.98)
    first = denominator_of(off.astype(complex))
    start = evaluate(lines, first, 0.0, degrees)
    s, size = 1j * lines.x, first.n_moving
    powers = s[:, None] ** np.arange(degrees[0] + 1)
    numerators = [state @ start.polynomials.powers(element) for element, state in enumerate(start.coefficients)]
    costs = {}

    def left(values):
        A = np.ones(len(s), dtype=complex)
        for index, w in enumerate(first.sizes[: size // 2]):
            A = A * (s * s + w * values[2 * index] * s + w**2 * values[2 * index + 1])
        if size % 2:
            A = A * (s + first.sizes[-1] * values[size - 1])
        model = (powers @ values[size:].reshape(lines.n_element, -1).T).T / A
        return (lines.y - lines.weights * model).ravel().view(float)

    def reference():
        begin = np.concatenate([first.coefficients, np.ravel(numerators)])
        costs["reference"] = 2 * least_squares(left, begin, x_scale="jac", max_nfev=300).cost

    def ours():
        costs["ours"] = descend(lines, first, 0.0, degrees, max_iterations=100, tolerance=1e-8).cost

    compare(f"external.response_vs_scipy{key}", ours, reference, 5)
    # The reference may stop on its way; it must not find anything better.
    assert costs["ours"] <= costs["reference"] * (1 + 1e-4)
