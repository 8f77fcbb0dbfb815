"""The choice of configurations against a general cone solver, and the time that large ones take."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robid.design.configurations.candidates import candidate_information
from robid.design.configurations.criteria import worth
from robid.design.configurations.for_prediction import design_for_prediction
from robid.design.configurations.information import design_configurations
from robid.design.configurations.interior import Packed, pack
from robid.design.configurations.options import DesignOptions, InformationOptions
from robid.design.configurations.prediction import joined
from robid.design.configurations.relaxed import relaxed_design
from robid.models.known import load_experiment
from robid.pipeline.configurations import draw_in_reach
from robid.pipeline.design_prediction import assumed_parts
from robid.pipeline.design_tasks import AssumedTask
from robid.settings.experiment import RandomConfigurations
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


def test_a_choice_for_prediction(keep):
    """The whole choice, from the robot file on, against a D-optimal one of the same candidates."""
    loaded = load_experiment(Path(__file__).parents[2] / "configs/kr300.yaml")
    robot = loaded.robot.to_robot()
    candidates = draw_in_reach(loaded, robot, RandomConfigurations(count=300, seed=1))
    lines_hz = np.round(5 * np.geomspace(2, 80, 60)) / 5
    about = InformationOptions(nuisance=("viscous",))
    task = AssumedTask((robot,), about, 1e-3, candidates, lines_hz, 1e-3)
    wanted = about.free, about.along(), about.fixed
    limits = robot, candidates, lines_hz, 1e-3, 1e-3, about.assumed_relative_error

    def d_optimal():
        matrices, names = candidate_information(*limits, kinds=wanted[0], nuisance=wanted[1])
        return matrices, names, design_configurations(matrices, candidates, names, DesignOptions())

    def predictive(matrices, names):
        parts = [
            assumed_parts(replace(task, configurations=part), np.full(len(names), 0.02))
            for part in np.array_split(candidates, 15)
        ]
        options = DesignOptions(criterion="prediction")
        return design_for_prediction(joined(parts, [20] * 15), matrices[None], candidates, names, options)

    (matrices, names, _), usual = timed(d_optimal)
    found, seconds = timed(lambda: predictive(matrices, names))
    told = (
        f"(time over that of D, below is faster: {seconds + usual:.3g} s, {usual:.3g} s; bound {found.efficiency:.2f})"
    )
    keep("design.prediction_vs_d", (seconds + usual) / usual, told)
