"""The elastic fit against general-purpose optimizers, on one problem to one minimum."""

import time
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares, minimize

from default_campaign import CONFIGURATION, DELAY_S, ROBOT, default_experiment
from exact_systems import exact_frf, with_spring_factors
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.models.elastic.fit.fitting import fit_elastic, set_up
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.simulate.experiment import simulate
from robid.simulate.options import Imperfections, Truth
from robid.simulate.truth import true_robot
from rollout_toolbox import AVAILABLE, identify_by_rollouts

_SAME_MINIMUM = 1e-4
_BUDGET = 1000.0
"""Up to so many times our own time for others that do not reach our accuracy."""


@pytest.fixture(scope="module")
def problem():
    """Fifteen configurations, sixty lines, thirteen springs and dampers up to a factor of two off."""
    generator = np.random.default_rng(2)
    configurations = generator.uniform(ROBOT.lower, ROBOT.upper, (15, len(ROBOT.joints)))
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


def linear_record():
    """One configuration of the default robot without friction, from rest, one block of six experiments, and its truth.

    The first period is the transient, which only the frequency response leaves out.
    """
    experiment = default_experiment(1.0, 2)
    robot = true_robot(ROBOT, Truth(spring_factor=2, seed=1))
    options = replace(experiment.options, imperfections=Imperfections(encoder_noise_rad=1e-5), transient_periods=0)
    experiment = replace(experiment, robot=robot, options=options, reference=experiment.reference[:2])
    return simulate(experiment, CONFIGURATION, 0), robot


def fit_periodic(record):
    """Our springs from the record: response of its last period and fit."""
    last = replace(record, inputs=record.inputs[:, :, :, 1:], outputs=record.outputs[:, :, :, 1:])
    frf = estimate_frf(last, EstimateOptions(compensation="none"), None, DELAY_S)
    return fit_elastic(ROBOT, frf, ElasticOptions(free=("stiffness", "damping")), DELAY_S)


def spring_error(factors, robot):
    """Root mean square relative error of the springs, given as factors (n_spring,) on the robot file's values."""
    true = [spring.stiffness / nominal.stiffness
            for spring, nominal in zip(robot.springs, ROBOT.springs, strict=True)]  # fmt: skip
    return float(np.sqrt(np.mean((factors / np.array(true) - 1) ** 2)))


@pytest.mark.skipif(not AVAILABLE, reason="mujoco.sysid lacks its packages: absl-py, colorama, PyYAML, tabulate")
def test_against_time_domain_toolbox(keep):
    """MuJoCo's own toolbox on rollouts of the same record's first block, last period.

    Rollouts are open loop, so they run over windows of a quarter of a second and start from the true robot's exact
    state, which no measurement has; torque and delay are known too. That favours the toolbox, as does taking its
    first iterate that is as accurate as ours for its end.
    """
    record, robot = linear_record()
    solution, seconds = None, np.inf
    for _ in range(3):
        solution, needed = timed(lambda: fit_periodic(record))
        seconds = min(seconds, needed)
    found = np.array(
        [solution.estimate.found[f"{spring.name}.stiffness"] / spring.stiffness for spring in ROBOT.springs]
    )
    our_error = spring_error(found, robot)
    begun, reached = time.perf_counter(), []

    def stop(factors):
        reached.append((time.perf_counter() - begun, spring_error(factors, robot)))
        return reached[-1][1] <= our_error or reached[-1][0] > _BUDGET * seconds

    identify_by_rollouts(record, robot, ROBOT, CONFIGURATION, DELAY_S, stop)
    theirs, their_error = reached[-1]
    remark = f"(ours {seconds:.3g} s to {100 * our_error:.2g} %, theirs {theirs:.3g} s to {100 * their_error:.2g} %)"
    keep("fit.vs_mujoco_sysid", theirs / seconds, remark)
    keep("fit.robid_error", our_error, "(springs, root mean square, relative)")
    keep("fit.mujoco_sysid_error", their_error, "(the same at the end of its time)")
