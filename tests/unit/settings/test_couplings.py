"""Motors that turn the same combination of joints are told apart from those of sound wrists."""

import numpy as np
import pytest

from robid.settings.checks.robot import check_robot
from robid.settings.robot import RobotFile
from robid.settings.yaml import parse_yaml


def told(tmp_path, turns, slides=()):
    """What is said of arm motion per motor angle (n, n), as sentences."""
    joints = []
    for row, line in enumerate(turns):
        couplings = ", ".join(f"a{column}: {turn:.17g}" for column, turn in enumerate(line) if turn and column != row)
        ratio, unit, kind = (
            ("gear_ratio_rad_m", "m", ", type: prismatic") if row in slides else ("gear_ratio", "deg", "")
        )
        joints.append(
            f"- {{name: a{row}{kind}, rigid: true, frame: {{}}, limits_{unit}: [-1, 1], couplings: {{{couplings}}},"
            " link: {mass_kg: 1, com_m: [0, 0, 0], inertia_kgm2: {xx: 1, yy: 1, zz: 1}},"
            f" motor: {{inertia_kgm2: 1.0e-4, {ratio}: {1 / line[row]:.17g}}}}}"
        )
    text = "schema_version: 1\nname: wrist\njoints:\n" + "\n".join(joints) + "\n"
    document = parse_yaml(tmp_path / "robot.yaml", text)
    problems = check_robot(document, RobotFile.model_validate(document.data))
    return [str(problem) for problem in problems if "S253" in str(problem)]


@pytest.mark.parametrize("rounded", [0.0, 0.01, -0.03, 0.13])
def test_a_differential_without_its_minus_names_both_motors(tmp_path, rounded):
    turns = np.array([[1 / 40, 0, 0], [0, 1 / 56.5, (1 + rounded) / 56.5], [0, 1 / 56.5, 1 / 56.5]])
    (found,) = told(tmp_path, turns)
    assert "`a1`" in found
    assert "`a2`" in found
    assert "`a0`" not in found
    assert "joints[2].couplings" in found


def test_unequal_gears_and_a_slide_do_not_hide_it(tmp_path):
    # Arm motion in rad and m per motor angle: the rows differ in unit and size, the combination is one.
    turns = np.array([[1 / 20, 1 / 90], [0.004 / 20, 0.004 / 90]])
    assert told(tmp_path, turns, slides=(1,))
    turns[1, 0] *= -1
    assert not told(tmp_path, turns, slides=(1,))


def test_three_motors_of_which_one_is_the_sum_of_the_others(tmp_path):
    turns = np.array([[1.0, 0.2, 1.2], [0.3, 1, 1.3], [0.5, 0.4, 0.9]]) / 100
    (found,) = told(tmp_path, turns)
    assert all(f"`a{index}`" in found for index in range(3))


def test_sound_couplings_are_not_accused(tmp_path):
    rng = np.random.default_rng(4)
    for _ in range(8):
        ratio = rng.uniform(20, 200, 3) * rng.choice([-1, 1], 3)
        # A wrist whose motors turn all joints beyond along, by more or less than their own.
        below = np.eye(3) + np.tril(rng.uniform(-2, 2, (3, 3)), -1)
        assert not told(tmp_path, below / ratio)
        # A differential behind any gears, its sum on either joint.
        differential = np.array([[1, 0, 0], [0, 1, 1], [0, 1, -1]]) * rng.uniform(0.5, 2, 3)[:, None]
        assert not told(tmp_path, differential / ratio)
        assert not told(tmp_path, differential[[0, 2, 1]] / ratio)
