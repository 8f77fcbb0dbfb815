"""Friction that a rigid fit found, as laws that a response's torque is freed from."""

from dataclasses import replace

import numpy as np
import pytest

from robid.frf.laws import with_levels
from robid.robot.friction import TorqueLaw, friction_torque

STATED = TorqueLaw(2.0, 3.0, 1.5, 0.02, 0.1, 0.5, 6)


def one(law=STATED, level=2.5, std=0.05, uneven=0.0):
    return with_levels([law], np.array([level]), np.array([std]), np.array([uneven]))[0]


def test_the_level_is_the_fits_and_the_shape_the_files():
    law = one()
    assert (law.coulomb_nm, law.static_nm) == (2.5, 3.75)
    assert (law.stribeck_rad_s, law.width, law.ripple_nm) == (1.5, 0.02, 0.5)
    assert law.offset[:2] == pytest.approx((0.25, 0.0))


def test_the_coefficients_are_as_uncertain_as_the_fit_says():
    level, shape, lag, sine, cosine = one().coefficient_std
    # Coefficients count in units of the robot file's values: 0.05 of 2 N m.
    assert level == pytest.approx(0.025)
    assert shape == pytest.approx(STATED.relative_std)
    assert (lag, sine, cosine) == STATED.coefficient_std[2:]
    # Coulomb and breakaway levels, Stribeck speed, presliding.
    assert one().values_std[:4] == pytest.approx((0.05, 0.075, 0.15, 0.002))


def test_a_level_below_zero_and_a_file_without_friction_make_laws():
    assert one(level=-0.1).coulomb_nm == 0
    law = one(replace(STATED, coulomb_nm=0.0, static_nm=0.0))
    assert (law.coulomb_nm, law.static_nm, law.offset[0]) == (2.5, 2.5, 0.0)
    assert law.coefficient_std[0] == pytest.approx(0.05 / 2.5)


def test_uneven_viscous_friction_is_a_torque_per_size_of_the_speed():
    speed = 20 * np.sin(np.linspace(0, 2 * np.pi, 400, endpoint=False))[:, None]
    even, uneven = (friction_torque(speed, 1e-3, [one(uneven=more)]) for more in (0.0, 0.03))
    np.testing.assert_allclose(uneven - even, 0.03 * np.abs(speed), atol=1e-12)
    assert not replace(STATED, coulomb_nm=0.0, ripple_nm=0.0, uneven_nms_rad=0.03).is_zero
