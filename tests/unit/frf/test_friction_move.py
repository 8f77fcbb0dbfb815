"""Friction that moves a response: columns times rows where each coefficient is one motor's."""

import numpy as np
import pytest

from robid.frf.friction import FrictionMove, motor_friction_move

SCALES = np.array([0.4, -0.2, 0.7, 0.1])
MOTORS = [0, 2, 2, 1]


@pytest.fixture
def move():
    generator = np.random.default_rng(1)

    def drawn(*shape):
        return generator.standard_normal(shape) + 1j * generator.standard_normal(shape)

    share = np.zeros((7, 3, len(MOTORS), 3), complex)
    for coefficient, motor in enumerate(MOTORS):
        share[:, motor, coefficient] = 0.1 * drawn(7, 3)
    return FrictionMove(drawn(7, 5, 3), share)


def test_columns_times_rows_are_the_derivative(move):
    fast = motor_friction_move(move)
    moved, rows = fast.moved(SCALES)
    np.testing.assert_allclose(moved, move.moved(SCALES), rtol=1e-12)
    slopes = moved[:, :, MOTORS, None] * rows[:, None]
    np.testing.assert_allclose(np.moveaxis(slopes, -2, -1), move.slopes(SCALES), rtol=1e-12)
    for index in range(len(MOTORS)):
        step = 1e-6 * (np.arange(len(MOTORS)) == index)
        change = (fast.moved(SCALES + step)[0] - fast.moved(SCALES - step)[0]) / 2e-6
        np.testing.assert_allclose(slopes[:, :, index], change, rtol=1e-6, atol=1e-8)


def test_a_coefficient_of_two_motors_has_no_such_form(move):
    move.share[:, 1, 0] = 1e-3
    assert motor_friction_move(move) is None
    move.share[:, 1, 0] = 1e-14  # rounding
    assert motor_friction_move(move) is not None
