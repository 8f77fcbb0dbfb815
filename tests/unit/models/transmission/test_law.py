"""The law of a gear: against its closed forms, and against a walk through all samples."""

from dataclasses import replace

import numpy as np
import pytest

from robid.models.transmission.fit.law import GearLaw, data_sheet_loop, deflections, memories


def law(stiffness=2e6, stiffening=0.0, slip=0.0, reach=1e-5, backlash=0.0):
    return GearLaw(*(np.array([value]) for value in (stiffness, stiffening, slip, reach, backlash)))


def test_a_linear_gear_has_the_lost_motion_of_its_stiffness_and_no_hysteresis():
    loop = data_sheet_loop(law(), 1000.0, 10.0)
    assert loop.torque[0] == pytest.approx(-1000)
    assert loop.torque[-1] == pytest.approx(-1000)
    assert loop.lost_motion(1000.0)[0] == pytest.approx(0.06 * 1000 / 2e6, rel=1e-3)
    assert loop.width()[0] == pytest.approx(0, abs=1e-12)


def test_hysteresis_that_builds_up_at_once_is_twice_its_torque_wide():
    loop = data_sheet_loop(law(slip=50.0, reach=1e-7), 1000.0, 10.0)
    assert loop.width()[0] == pytest.approx(2 * 50 / 2e6, rel=1e-3)


def test_backlash_adds_to_lost_motion():
    loop = data_sheet_loop(law(backlash=4e-5), 1000.0, 1.0)
    assert loop.lost_motion(1000.0)[0] == pytest.approx(0.06 * 1000 / 2e6 + 4e-5, rel=1e-3)


def test_a_stiffening_gear_solves_its_cubic():
    torque = np.linspace(-1000, 1000, 41)[:, None]
    x = deflections(law(stiffening=3e6), torque, 10.0, np.zeros(1))
    np.testing.assert_allclose(2e6 * x * (1 + 3e6 * x**2), torque, rtol=1e-8, atol=1e-6)


def test_stiffness_that_rises_in_steps_bends_by_the_sum_of_its_pieces():
    gear = replace(law(), torques=np.array([200.0, 600.0]), rises=np.array([[0.25, 0.35]]))
    torque = np.array([-1000.0, -300, 0, 100, 200, 400, 600, 1000])[:, None]
    x = deflections(gear, torque, 10.0, np.zeros(1))[:, 0]
    size = np.abs(torque[:, 0])
    pieces = (
        np.minimum(size, 200) / 2e6
        + np.clip(size - 200, 0, 400) / (1.25 * 2e6)
        + np.maximum(size - 600, 0) / (1.6 * 2e6)
    )
    np.testing.assert_allclose(x, np.sign(torque[:, 0]) * pieces, rtol=1e-9, atol=1e-12)


def test_from_rest_hysteresis_goes_to_its_slip_torque_exponentially():
    torque = np.linspace(0, 500, 2000)[:, None]
    x = deflections(law(slip=50.0, reach=2e-5), torque, 10.0, np.zeros(1))[:, 0]
    np.testing.assert_allclose(2e6 * x + 50 * (1 - np.exp(-x / 2e-5)), torque[:, 0], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("noise", [0.0, 3e-6])
def test_memory_is_that_of_a_walk_through_all_samples(noise):
    rng = np.random.default_rng(3)
    course = np.convolve(np.cumsum(rng.standard_normal(3000)) * 1e-5, np.ones(5) / 5, "same")
    reach, start = np.array([3e-4, 1e-4]), np.array([0.2, -0.5])
    found = memories(course, reach, start, noise)
    for column in range(2):
        place, memory = course[0], start[column]
        for row, now in enumerate(course):
            moved = now - place
            counted = moved - np.clip(moved, -noise, noise)
            place += counted
            sense = np.sign(counted)
            memory = sense + (memory - sense) * np.exp(-abs(counted) / reach[column]) if counted else memory
            assert found[row, column] == pytest.approx(memory, abs=1e-12)
