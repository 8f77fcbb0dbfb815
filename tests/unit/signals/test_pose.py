"""Angles A B C and displacements against independent formulas."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robid.arrays import FloatArray
from robid.signals.pose import displaced_pose, displacement, rotation_from_zyx, zyx_from_rotation
from tolerances import IDENTITY

_ABC = np.random.default_rng(1).uniform([-3, -1.5, -3], [3, 1.5, 3], (20, 3))


def _axis(name: str, angle: float) -> FloatArray:
    return np.asarray(Rotation.from_euler(name, angle).as_matrix())


def test_angles_turn_about_z_then_the_new_y_then_the_newest_x() -> None:
    expected = Rotation.from_euler("ZYX", _ABC).as_matrix()
    np.testing.assert_allclose(rotation_from_zyx(_ABC), expected, atol=IDENTITY)
    np.testing.assert_allclose(
        rotation_from_zyx(np.array([0.3, 0.2, 0.1])), _axis("z", 0.3) @ _axis("y", 0.2) @ _axis("x", 0.1), atol=IDENTITY
    )


def test_angles_come_back() -> None:
    for abc in _ABC:
        np.testing.assert_allclose(zyx_from_rotation(rotation_from_zyx(abc)), abc, atol=IDENTITY)


def test_angles_do_not_jump_where_they_pass_half_a_turn() -> None:
    time = np.linspace(0, 1, 200)
    abc = np.stack([9 * time, 0.5 * np.sin(9 * time), -7 * time], axis=-1)
    both = np.stack([abc, abc[:, [2, 1, 0]]])
    np.testing.assert_allclose(zyx_from_rotation(rotation_from_zyx(both)), both, atol=IDENTITY)


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_an_upright_tool_has_no_c_and_its_rotation_comes_back(up: float) -> None:
    rotation = rotation_from_zyx(np.array([0.4, up * np.pi / 2, 0.3]))
    abc = zyx_from_rotation(rotation)
    assert abc[2] == 0
    np.testing.assert_allclose(rotation_from_zyx(abc), rotation, atol=IDENTITY)


def test_displacements_lie_along_the_axes_of_the_home_pose() -> None:
    home = np.array([1.0, 2.0, 3.0]), _axis("z", np.pi / 2)
    away = displacement(*home, np.array([[1.0, 2.5, 3.0]]), (home[1] @ _axis("y", 0.2))[None])
    np.testing.assert_allclose(away, [[0.5, 0, 0, 0, 0.2, 0]], atol=IDENTITY)


def test_displacements_come_back() -> None:
    generator = np.random.default_rng(2)
    home = generator.standard_normal(3), rotation_from_zyx(generator.standard_normal(3))
    displaced = np.cumsum(generator.standard_normal((2, 30, 6)) * 0.05, axis=1)
    np.testing.assert_allclose(displacement(*home, *displaced_pose(*home, displaced)), displaced, atol=IDENTITY)
