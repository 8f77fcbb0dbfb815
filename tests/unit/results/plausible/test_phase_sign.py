"""Responses whose phase has the wrong sign are named; late ones, reversed ones and those with a record never."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot
from robid.frf.frf import NO_RECORD
from robid.frf.quality import driving_points, is_conjugate
from robid.results.plausible.findings import data_findings

LINES = np.geomspace(3.0, 200.0, 60)
PLACES = np.random.default_rng(3).uniform(-1, 1, (3, 2))


def given(delay_s=0.0, hold="zoh", noise=0.01):
    """The exact response of a robot, measured elsewhere."""
    timing = {"sampling_period_s": 5e-4, "torque_hold": hold, "delay_s": delay_s}
    frf = exact_frf(two_joint_robot(), PLACES, LINES, **timing, relative_noise=noise, declared_noise=noise)
    return replace(frf, notes=(NO_RECORD,))


def turned(frf):
    return replace(frf, response=frf.response.conj())


@pytest.mark.parametrize("hold", ["zoh", "band_limited"])
@pytest.mark.parametrize("delay_s", [0.0, 0.002])
def test_a_conjugate_is_named_first_and_only_without_a_record(delay_s, hold):
    frf = turned(given(delay_s, hold))
    found = data_findings(two_joint_robot(), frf, delay_s)
    assert (found[0].cause, found[0].decisive) == ("units", True)
    assert "phase" in found[0].message
    assert "delay" not in [each.cause for each in found]
    recorded = data_findings(two_joint_robot(), replace(frf, notes=()), delay_s)
    assert not any("conjugate" in each.message for each in recorded)


@pytest.mark.parametrize("late_s", [0.0, 5e-4, 2e-3, 5e-3, 0.02])
@pytest.mark.parametrize("sign", [1, -1])
def test_sound_late_and_reversed_responses_are_no_conjugates(late_s, sign):
    frf = given(late_s)
    assert not is_conjugate(driving_points(replace(frf, response=sign * frf.response)), 0.0)


@pytest.mark.parametrize("late_s", [2e-3, 5e-3])
def test_a_delay_stays_a_delay(late_s):
    found = data_findings(two_joint_robot(), given(late_s))
    assert found[0].cause == "delay"
