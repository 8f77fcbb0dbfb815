"""Optimizers behind one signature: the same minimum, bounds, honest ends."""

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot, with_spring_factors
from robid.models.elastic.fit.fitting import set_up
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.options import ElasticOptions, Weights

CONFIGURATIONS = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2]])
FREQUENCY_HZ = np.geomspace(1, 60, 25)
OPTIMIZERS = ("levenberg", "scipy", "nlopt", "nlopt_global")


def noisy_problem(**options):
    robot = with_spring_factors(two_joint_robot(), [1.3, 0.8, 1.2, 0.9])
    frf = exact_frf(robot, CONFIGURATIONS, FREQUENCY_HZ, relative_noise=0.005, seed=1)
    chosen = ElasticOptions(free=("stiffness", "damping"), weights=Weights("user"), **options)
    return set_up(two_joint_robot(), frf, chosen, 0.0)[0]


@pytest.fixture(scope="module")
def minimum():
    problem = noisy_problem()
    return optimise(problem, np.zeros(8))


@pytest.mark.parametrize("optimizer", OPTIMIZERS)
def test_all_reach_the_same_minimum(optimizer, minimum):
    found = optimise(noisy_problem(), np.full(8, 0.12), optimizer=optimizer, max_iterations=100)
    assert found.status == "converged"
    assert found.cost == pytest.approx(minimum.cost, rel=1e-8)
    np.testing.assert_allclose(found.parameters, minimum.parameters, atol=1e-4)
    assert found.evaluations >= found.iterations > 0


@pytest.mark.parametrize("optimizer", OPTIMIZERS)
def test_bounds_hold_everywhere(optimizer, minimum):
    problem = noisy_problem(bounds={"gear_1.stiffness": (1.5e4, 2.5e4)})
    found = optimise(problem, np.zeros(8), optimizer=optimizer)
    values = dict(zip(problem.parameters.names, problem.parameters.values(found.parameters), strict=True))
    assert values["gear_1.stiffness"] == pytest.approx(2.5e4, rel=1e-6)
    assert values["gear_1.stiffness"] <= 2.5e4 * (1 + 1e-12)
    here = problem.normal(found.parameters)
    assert here.gradient[0] < 0
    size = np.sqrt(np.diag(here.hessian) * here.cost)
    np.testing.assert_allclose((here.gradient / size)[1:], 0, atol=1e-4)
    assert found.cost > minimum.cost


@pytest.mark.parametrize("optimizer", ["levenberg", "scipy", "nlopt"])
def test_a_limit_is_told(optimizer):
    assert optimise(noisy_problem(), np.zeros(8), optimizer=optimizer, max_iterations=2).status == "iteration_limit"


def test_the_global_one_leaves_a_local_minimum(minimum):
    # A bearing so stiff that nothing is seen of it.
    start = np.zeros(8)
    start[[2, 3]] = np.log(50), np.log(20)
    assert optimise(noisy_problem(), start).cost > 10 * minimum.cost
    found = optimise(noisy_problem(), start, optimizer="nlopt_global", max_iterations=100)
    assert found.cost == pytest.approx(minimum.cost, rel=1e-8)
