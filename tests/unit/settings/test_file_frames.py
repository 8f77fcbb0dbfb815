"""The frames in which a robot file states its bodies are those that the plain description knows of."""

import os
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from robid.errors import SettingsError
from robid.settings.load import load_robot

ROBOTS = Path(__file__).parents[3] / "configs" / "robots"
STEP_M = 1e-3


def moved(name, folder, change):
    """The plain robot of a file of which something is changed; its model stays where it is."""
    yaml = YAML(typ="safe")
    content = yaml.load((ROBOTS / name).read_text())
    change(content)
    model = content.get("model")
    if model and not model.startswith("$"):
        content["model"] = os.path.relpath(ROBOTS / model, folder)
    yaml.dump(content, folder / "moved.yaml")
    return load_robot(folder / "moved.yaml").to_robot()


@pytest.mark.parametrize("name", ["kr300.yaml", "ur5e.yaml", "puma560.yaml"])
def test_a_payload_moves_along_the_axes_that_are_noted(tmp_path, name):
    try:
        stated = load_robot(ROBOTS / name).to_robot()
    except SettingsError as error:
        pytest.skip(f"the model of {name} is not there: {error}")
    if not stated.payload.mass_kg:
        pytest.skip(f"{name} has no payload")
    for index in range(3):

        def shift(content, index=index):
            com = list(content["payload"].get("com_m", [0.0, 0.0, 0.0]))
            com[index] += STEP_M
            content["payload"]["com_m"] = com

        change = (moved(name, tmp_path, shift).payload.com_m - stated.payload.com_m) / STEP_M
        np.testing.assert_allclose(stated.payload_axes[:, index], change, atol=1e-9)


@pytest.mark.parametrize("joint", [0, 2, 4])
def test_links_move_along_theirs(tmp_path, joint):
    stated = load_robot(ROBOTS / "kr300.yaml").to_robot()
    for index in range(3):

        def shift(content, index=index):
            content["joints"][joint]["link"]["com_m"][index] += STEP_M

        robot = moved("kr300.yaml", tmp_path, shift)
        change = (robot.joints[joint].link.com_m - stated.joints[joint].link.com_m) / STEP_M
        np.testing.assert_allclose(stated.link_axes(joint)[:, index], change, atol=1e-9)
    # Of the robot itself they are no part: what is simulated does not know them.
    assert stated.file_frames is not None
