"""A log's angles beside its configuration: told where they agree once degrees are read as radians."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robid.pipeline.acquire import is_radians_note, radians_note
from robid.settings.load import load_robot
from robid.signals.quantities import Channel
from robid.signals.record import Record

ROBOT = load_robot(Path(__file__).parents[2] / "stages" / "arm.yaml")
NAMES = [joint.name for joint in ROBOT.joints]
RATIOS = np.array([joint.motor.ratio for joint in ROBOT.joints])


def _record(angles_rad, written_deg, arm):
    """A record around some arm angles, measured at arms or motors, of a configuration as the file writes it."""
    size = np.ones(2) if arm else RATIOS
    wave = 1e-3 * np.sin(np.linspace(0, 2 * np.pi, 50, endpoint=False))[:, None] * np.ones(2)
    channels = tuple(Channel(f"{n}.arm" if arm else n, "angle", "rad", "arm" if arm else "motor") for n in NAMES)
    shape = (1, 1, 1, 1, 50, 2)
    blank = Record(
        inputs=np.zeros(shape),
        outputs=(wave * size).reshape(shape),
        input_channels=tuple(Channel(name, "torque", "N m") for name in NAMES),
        output_channels=channels,
        sampling_period_s=1e-3,
        output_offset=(np.array(angles_rad) * size)[None],
    )
    return replace(blank, configurations=np.deg2rad([written_deg]))


@pytest.mark.parametrize("arm", [True, False])
@pytest.mark.parametrize("angles", [(0.7, -1.2), (1.5, 0.0), (-0.4, 3.0)])
def test_radians_that_stand_for_degrees_are_told(arm, angles):
    (note,) = radians_note(_record(angles, angles, arm), ROBOT)
    assert is_radians_note(note)
    assert f"{np.rad2deg(angles[0]):.4g} deg" in note


@pytest.mark.parametrize("arm", [True, False])
@pytest.mark.parametrize(
    ("angles", "written"),
    [
        ((0.7, -1.2), np.rad2deg([0.7, -1.2])),
        ((0.0, 0.0), (0.7, -1.2)),
        ((0.7, 0.3), (0.7, -1.2)),
        ((0.0, 0.0), (0.0, 0.0)),
    ],
)
def test_other_configurations_are_not(arm, angles, written):
    assert radians_note(_record(angles, written, arm), ROBOT) == ()
