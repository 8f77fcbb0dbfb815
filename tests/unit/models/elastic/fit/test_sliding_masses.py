"""The mass of a link that slides comes back, and goes into the fitted robot as a mass."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from exact_systems import exact_frf, with_spring_factors
from robid.models.elastic.fit.fitting import fit_elastic, set_up
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.models.elastic.fit.solution import fitted_robot
from robid.settings.load import load_robot
from tolerances import IDENTITY, RECOVERY

FREQUENCY_HZ = np.geomspace(2.0, 80.0, 50)
CONFIGURATIONS = np.array([[1.0, 1.2, -0.6], [2.0, -0.5, 0.1], [1.5, 0.4, -0.3]])
KINDS = ("stiffness", "damping", "link_inertia")


def test_carriage_of_a_gantry_is_weighed():
    file = load_robot(Path(__file__).parents[5] / "configs/robots/gantry.yaml").to_robot()
    nominal = replace(file, gravity_m_s2=np.zeros(3))
    carriage = nominal.joints[1]
    heavier = replace(carriage, link=replace(carriage.link, mass_kg=1.2 * carriage.link.mass_kg))
    joints = (nominal.joints[0], heavier, nominal.joints[2])
    true = replace(with_spring_factors(nominal, 1.3, 0.8), joints=joints)
    options = ElasticOptions(free=KINDS, fixed=("x.link_inertia", "z.link_inertia"), weights=Weights(kind="user"))
    solution = fit_elastic(nominal, exact_frf(true, CONFIGURATIONS, FREQUENCY_HZ), options, 0.0)
    assert dict(zip(solution.estimate.names, solution.estimate.units, strict=True))["y.link_inertia"] == "kg"
    assert solution.estimate.found["y.link_inertia"] == pytest.approx(300.0, rel=RECOVERY)
    found = fitted_robot(nominal, solution.estimate)
    assert found.joints[1].link.mass_kg == pytest.approx(300.0, rel=RECOVERY)
    for spring, wanted in zip(found.springs, true.springs, strict=True):
        assert spring.stiffness == pytest.approx(wanted.stiffness, rel=RECOVERY)


def test_fast_sums_are_left_where_a_link_slides_two_ways():
    robot = load_robot(Path(__file__).parents[5] / "configs/robots/gantry.yaml").to_robot()
    options = ElasticOptions(free=KINDS, weights=Weights(kind="user"))
    problem = set_up(robot, exact_frf(robot, CONFIGURATIONS, FREQUENCY_HZ), options, 0.0)[0]
    point = np.random.default_rng(1).uniform(-0.1, 0.1, len(problem.parameters.names))
    found, wanted = problem.normal(point), problem.stacked_normal(point)
    assert found.cost == pytest.approx(wanted.cost, rel=IDENTITY)
    np.testing.assert_allclose(found.gradient, wanted.gradient, rtol=1e-8, atol=1e-8 * np.abs(wanted.gradient).max())
    np.testing.assert_allclose(found.hessian, wanted.hessian, rtol=1e-8, atol=1e-8 * np.abs(wanted.hessian).max())
