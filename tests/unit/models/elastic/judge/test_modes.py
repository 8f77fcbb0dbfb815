"""Modes of a fitted arm against closed forms, and against the poles that resonances are tabled beside."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, springs_everywhere, two_joint_robot, two_mass_robot
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.fitted import fitted_model, poles
from robid.models.elastic.judge.modes import BESIDE_BAND, arm_modes, displacements, energy_shares
from robid.models.elastic.judge.resonances import tabulate_resonances
from robid.robot.description import Inertial, Spring
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import mass_matrix, nominal_parameters
from tolerances import IDENTITY

OPTIONS = ElasticOptions(free=("stiffness", "damping"), starts=1)
J1, J2, J3, K1, K2 = 4.0e-3, 6.0e-3, 5.0e-3, 500.0, 900.0


def chain():
    """Three inertias in a line with two springs, free of gravity."""
    robot = two_mass_robot(J1, J2, K1, 0.0)
    body = Inertial(1.0, np.zeros(3), J3 * np.eye(3))
    spring = Spring("hinge", 0, "payload", np.array([0.0, 0.0, 1.0]), K2, 0.0)
    return replace(robot, springs=(*robot.springs, spring), payload=body)


def linear_of(robot, configurations):
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, np.atleast_2d(configurations)))
    return linear, nominal_parameters(robot, linear, 0.0)


def fitted_of(robot, configurations, frequency_hz, options=OPTIONS):
    frf = exact_frf(robot, configurations, frequency_hz, relative_noise=1e-3)
    solution = fit_elastic(robot, frf, options, 0.0)
    return fitted_model(robot, solution, frf, options, 0.0), solution, frf


def test_a_chain_of_two_springs_has_the_closed_forms_frequencies_and_energies():
    linear, parameters = linear_of(chain(), [0.0])
    modes = poles(linear, parameters, 0)
    half = 0.5 * (K1 / J1 + (K1 + K2) / J2 + K2 / J3)
    square = half + np.array([-1, 1]) * np.sqrt(half**2 - K1 * K2 * (J1 + J2 + J3) / (J1 * J2 * J3))
    np.testing.assert_allclose(np.abs(modes.roots), np.sqrt(square), rtol=1e-9)
    # J1 a1 = -k1 d1 and J2 a2 = k1 d1 - k2 d2 give (k1/J1 + k1/J2 - w^2) d1 = k2/J2 d2 of the two deflections.
    ratio = (K1 / J1 + K1 / J2 - square) * J2 / K2
    first = K1 / (K1 + K2 * ratio**2)
    shares = energy_shares(linear, parameters, 0, modes)
    np.testing.assert_allclose(shares, np.stack([first, 1 - first], axis=1), rtol=1e-8)


@pytest.mark.parametrize("robot", [two_joint_robot(), springs_everywhere()], ids=["two joints", "springs everywhere"])
def test_elastic_energy_is_rayleighs(robot):
    free = replace(robot, gravity_m_s2=np.zeros(3), springs=tuple(replace(s, damping=0.0) for s in robot.springs))
    linear, parameters = linear_of(free, [[0.4, -0.7]])
    modes = poles(linear, parameters, 0)
    assert modes.roots.size == len(robot.springs)
    shares = energy_shares(linear, parameters, 0, modes)
    np.testing.assert_allclose(shares.sum(axis=1), 1, rtol=IDENTITY)
    mass = mass_matrix(linear, parameters)[0]
    for root, shape, share in zip(modes.roots, modes.shapes.T, shares, strict=True):
        # Of an undamped mode the elastic energy is the kinetic one, w^2 x' M x: so is each spring's share of it.
        kinetic = abs(root) ** 2 * np.real(shape.conj() @ mass @ shape)
        np.testing.assert_allclose(share * kinetic, parameters.stiffness * np.abs(shape[2:]) ** 2, rtol=1e-7, atol=1e-9)


def test_a_drives_mode_is_the_closed_forms():
    fitted, solution, _ = fitted_of(two_mass_robot(), [[0.0]], np.arange(11.0, 251.0))
    (modes,) = arm_modes(fitted)
    stiffness, damping = (solution.estimate.found[f"coupling.{kind}"] for kind in ("stiffness", "damping"))
    natural = np.sqrt(stiffness * (1 / 4.752e-3 + 1 / 4.780e-3))
    np.testing.assert_allclose(modes.frequency_hz, natural / (2 * np.pi), rtol=1e-9)
    np.testing.assert_allclose(modes.damping, damping / (2 * stiffness) * natural, rtol=1e-9)
    np.testing.assert_allclose(modes.energy, 1, rtol=IDENTITY)
    assert np.abs(modes.shape[0, :-2]).max() == 0  # the shaft turns on the spot: its axes alone show it


def test_modes_are_the_poles_that_resonances_are_tabled_beside():
    robot = two_joint_robot()
    lines = np.unique(np.round(np.geomspace(1, 60, 60), 1))
    fitted, solution, frf = fitted_of(robot, [[0.3, -0.4], [1.0, 0.6]], lines)
    found = arm_modes(fitted)
    table = tabulate_resonances(robot, solution, frf, OPTIONS, 0.0)
    told = np.isfinite(table.mode_hz) & (np.array(table.kind) == "resonance")
    assert told.sum() >= 4
    for configuration, hertz in zip(table.configuration[told], table.mode_hz[told], strict=True):
        assert np.abs(found[configuration].frequency_hz / hertz - 1).min() < 1e-12
    for modes in found:
        assert modes.frequency_hz.min() >= lines[0] / BESIDE_BAND
        assert modes.frequency_hz.max() <= lines[-1] * BESIDE_BAND
        sizes = np.linalg.norm(modes.shape, axis=2).max(axis=1)
        np.testing.assert_allclose(sizes, 1, rtol=IDENTITY)
        flat = modes.shape.reshape(len(modes.shape), -1)
        largest = flat[np.arange(len(flat)), np.abs(flat).argmax(axis=1)]
        np.testing.assert_allclose(largest, np.abs(largest), atol=IDENTITY)


def test_a_shape_keeps_what_is_in_quadrature_and_one_without_motion_stays_still():
    moves = np.zeros((2, 3, 2))
    moves[0, 0, 0] = moves[1, 1, 1] = 2.0
    turning = np.array([[0.5j, 0.0], [0.25, 0.0]])  # one point ahead of the other by a quarter of a period
    found = displacements(moves, turning)
    np.testing.assert_allclose(found[0], [[1, 0, 0], [0, -0.5j, 0]], atol=IDENTITY)
    assert not found[1].any()
