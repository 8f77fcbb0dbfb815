"""The choice of configurations against a general cone solver, and the time that large ones take."""

import time

import numpy as np
import pytest

from robid.design.configurations.criteria import worth
from robid.design.configurations.interior import Packed, pack
from robid.design.configurations.relaxed import relaxed_design
from smooth_designs import SIZE, smooth_information

_SAME_OPTIMUM = 1e-6


def timed(task):
    begun = time.perf_counter()
    return task(), time.perf_counter() - begun


@pytest.mark.parametrize("criterion", ["d", "a", "e"])
def test_three_hundred_candidates(keep, criterion):
    matrices = smooth_information(300)
    runs = [timed(lambda: relaxed_design(matrices, criterion=criterion)) for _ in range(6)]
    seconds = float(np.median([each for _, each in runs[1:]]))
    keep(f"design.{criterion}_300_ms", 1e3 * seconds, f"(gap {runs[0][0].gap:.1e})")


def test_hundred_thousand_candidates(keep):
    rows = np.concatenate([pack(part) for part in np.array_split(smooth_information(100_000), 20)])
    found, seconds = timed(lambda: relaxed_design(Packed(rows[None], SIZE)))
    assert found.gap <= 1e-8
    keep("design.d_100000_s", seconds, f"(gap {found.gap:.1e}, {np.count_nonzero(found.weights)} with weight)")


@pytest.mark.filterwarnings("ignore")
def test_against_cvxpy(keep):
    """The sum of the logarithms of a triangular factor's diagonal, as in cvxpy's own `log_det`."""
    cp = pytest.importorskip("cvxpy", reason="cvxpy is not installed")
    matrices = smooth_information(3000) / 100
    weights = cp.Variable(len(matrices), nonneg=True)
    total = cp.reshape(matrices.reshape(len(matrices), -1).T @ weights, (SIZE, SIZE), order="F")
    problem = cp.Problem(cp.Maximize(cp.log_det(total)), [cp.sum(weights) == 1])
    _, theirs = timed(lambda: problem.solve(solver="CLARABEL"))
    reached = np.maximum(weights.value, 0) / np.maximum(weights.value, 0).sum()
    runs = [timed(lambda: relaxed_design(matrices)) for _ in range(6)]
    ours, seconds = runs[0][0], float(np.median([each for _, each in runs[1:]]))
    assert float(worth("d", np.einsum("i,ijk->jk", reached, matrices)[None])) == pytest.approx(
        ours.worth, rel=_SAME_OPTIMUM
    )
    keep(
        "design.vs_cvxpy_3000",
        theirs / seconds,
        f"(ours {1e3 * seconds:.3g} ms, gap {ours.gap:.1e}; cvxpy with Clarabel {theirs:.3g} s)",
    )
