"""A motor's speed tells the same springs as its angle of the same run, whatever its samples are."""

import csv
import json

import numpy as np
import pytest

TRUTH = {"coupling.stiffness": 700.0, "drive.motor_inertia": 4.8e-3, "drive.link_inertia": 6e-3}
_ERROR = 1e-3  # the nine digits of the angle leave as much


@pytest.mark.parametrize(
    ("sampled", "high_hz"),
    [("instants", 120), ("instants", 250), ("difference", 250), ("central_difference", 120)],
)
def test_speed_gives_the_springs_that_the_angle_gives(case, high_hz, sampled):
    folder = case("sampled_speed")
    settings = folder.folder / "speed.yaml"
    _replace(settings, "high_hz: 120", f"high_hz: {high_hz}")
    if sampled != "instants":
        _write_differences(folder.folder / "all.csv")
        _replace(settings, '"motor_speed [rpm]", unit: rpm', f"{sampled}, unit: rad/s, sampled: {sampled}")
    answer = folder.robid("run", "speed.yaml")
    assert answer.code == 0, answer.err
    found = json.loads((folder.folder / "runs" / "spd100" / "summary.json").read_text())
    for name, value in TRUTH.items():
        assert found[f"fits.two.parameters.{name}.estimate"] == pytest.approx(value, rel=_ERROR)
    assert abs(found["fits.two.parameters.delay.estimate"]) < 1e-6


def _replace(file, text, by):
    content = file.read_text()
    assert text in content
    file.write_text(content.replace(text, by))


def _write_differences(file):
    """Adds what drives do that differentiate the encoder's angle."""
    with file.open(newline="") as opened:
        names, *rows = csv.reader(opened)
    values = np.array(rows, float)
    angle = values[:, names.index("motor_angle [rad]")]
    back, central = np.zeros((2, angle.size))
    back[1:] = np.diff(angle) / 1e-3
    central[1:] = (np.append(angle[2:], angle[-1000]) - angle[:-1]) / 2e-3  # the last one as a period before
    header = ",".join([*names, "difference", "central_difference"])
    np.savetxt(file, np.column_stack([values, back, central]), fmt="%.12g", delimiter=",", header=header, comments="")
