"""The elastic fit against general-purpose optimizers, on one problem to one minimum."""

import time

import numpy as np
import pytest
from scipy.optimize import least_squares, minimize

from default_campaign import DELAY_S, ROBOT
from exact_systems import exact_frf, with_spring_factors
from robid.fit.elastic import set_up
from robid.fit.optimizers import optimise
from robid.fit.options import ElasticOptions, Weights

_SAME_MINIMUM = 1e-4


@pytest.fixture(scope="module")
def problem():
    """Fifteen configurations, sixty lines, thirteen springs and dampers up to a factor of two off."""
    generator = np.random.default_rng(2)
    configurations = generator.uniform(ROBOT.lower_rad, ROBOT.upper_rad, (15, len(ROBOT.joints)))
    factors = np.exp(np.log(2) * generator.uniform(-1, 1, (2, len(ROBOT.springs))))
    robot = with_spring_factors(ROBOT, *factors)
    frf = exact_frf(robot, configurations, np.geomspace(2, 80, 60), delay_s=DELAY_S, relative_noise=0.02)
    options = ElasticOptions(free=("stiffness", "damping"), weights=Weights("user"))
    return set_up(ROBOT, frf, options, DELAY_S)[0]


def timed(task):
    begun = time.perf_counter()
    return task(), time.perf_counter() - begun


def ours(problem):
    """Our minimum and the median time of five descents to it."""
    start = np.zeros(len(problem.parameters.names))
    runs = [timed(lambda: optimise(problem, start)) for _ in range(6)]
    return runs[0][0], float(np.median([seconds for _, seconds in runs[1:]]))


def test_cost_and_normal_equations(keep, problem):
    """Absolute times, for what they are worth elsewhere."""
    generator = np.random.default_rng(3)
    for name, task in (("cost", problem.cost), ("normal", problem.normal), ("all_residuals", problem.stacked_normal)):
        points = generator.uniform(-0.3, 0.3, (15, len(problem.parameters.names)))
        keep(f"fit.{name}_ms", 1e3 * float(np.median([timed(lambda p=p, t=task: t(p))[1] for p in points])))


def test_against_bfgs_on_finite_differences(keep, problem):
    end, seconds = ours(problem)
    start = np.zeros(end.parameters.size)
    scaled = problem.cost(start)
    found, theirs = timed(
        lambda: minimize(
            lambda x: problem.cost(x) / scaled, start, method="BFGS", options={"gtol": 1e-7, "maxiter": 2000}
        )
    )
    assert found.fun * scaled == pytest.approx(end.cost, rel=_SAME_MINIMUM)
    keep(
        "fit.vs_bfgs",
        theirs / seconds,
        f"(ours {1e3 * seconds:.3g} ms, {end.evaluations} evaluations; BFGS {theirs:.3g} s, {found.nfev})",
    )


def test_against_two_point_least_squares(keep, problem):
    end, seconds = ours(problem)

    def residual(internal):
        error = problem.weighted(problem.residual(internal, problem.model_response(internal))).ravel()
        return np.concatenate([error.real, error.imag, np.sqrt(0.5) / problem.parameters.prior_std * internal])

    start = np.zeros(end.parameters.size)
    found, theirs = timed(lambda: least_squares(residual, start, jac="2-point", x_scale="jac", ftol=1e-10, xtol=1e-8))
    assert 2 * found.cost == pytest.approx(end.cost, rel=_SAME_MINIMUM)
    keep(
        "fit.vs_scipy_2point",
        theirs / seconds,
        f"(ours {1e3 * seconds:.3g} ms; least_squares {theirs:.3g} s, {found.njev} Jacobians)",
    )
