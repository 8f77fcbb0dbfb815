"""Rotation matrices against SciPy's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from robid.robot.inertia import roll_pitch_yaw, turn_about
from tolerances import IDENTITY

ANGLES = st.floats(-720, 720)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
@given(angle_deg=ANGLES)
def test_a_turn_is_scipys(axis, angle_deg):
    wanted = Rotation.from_euler(axis, angle_deg, degrees=True).as_matrix()
    np.testing.assert_allclose(turn_about(axis, angle_deg), wanted, rtol=0, atol=IDENTITY)


@given(angles_deg=st.tuples(ANGLES, ANGLES, ANGLES))
def test_three_turns_are_about_the_fixed_axes(angles_deg):
    wanted = Rotation.from_euler("xyz", angles_deg, degrees=True).as_matrix()
    np.testing.assert_allclose(roll_pitch_yaw(angles_deg), wanted, rtol=0, atol=IDENTITY)
