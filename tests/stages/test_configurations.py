"""From the configurations of an experiment file to joint angles in reach."""

import numpy as np
import pytest

from robid.artifacts.kinds import DESIGN, EXCITATION, design_from_artifact, excitation_from_artifact
from robid.artifacts.store import read_artifact
from robid.errors import SettingsError
from robid.models.known import load_experiment
from robid.pipeline.configurations import configurations_of
from tolerances import IDENTITY


def _angles_deg(shop, section):
    shop.change("configurations: {list_deg: [[20, 30]]}", f"configurations: {section}")
    loaded = load_experiment(shop.folder / "small.yaml")
    return np.rad2deg(configurations_of(loaded, loaded.experiment.campaigns["validation"], {}))


def test_listed_and_on_a_grid_in_a_row(shop):
    found = _angles_deg(shop, "{join: [{list_deg: [[5, 6]]}, {grid_deg: [[0, 10], [20, 30, 40]]}]}")
    expected = [[5, 6], *([a, b] for a in (0, 10) for b in (20, 30, 40))]
    np.testing.assert_allclose(found, expected, rtol=IDENTITY, atol=1e-12)


def test_drawn_ones_keep_their_margin_and_are_uniform(shop):
    found = _angles_deg(shop, "{random: {count: 500, seed: 3, margin_deg: 5}}")
    assert found.shape == (500, 2)
    np.testing.assert_allclose(found.min(axis=0), [-145, -55], atol=2)
    np.testing.assert_allclose(found.max(axis=0), [145, 95], atol=2)
    assert (found.min(axis=0) >= [-145, -55]).all()
    assert (found.max(axis=0) <= [145, 95]).all()


def test_what_is_below_the_floor_is_drawn_again_and_the_rest_stays(shop):
    shop.change("controller:", "floor_m: 0\ncontroller:", file="arm.yaml")
    above = _angles_deg(shop, "{random: {count: 50, seed: 3}}")
    shop.change("floor_m: 0\n", "", file="arm.yaml")
    loaded = load_experiment(shop.folder / "small.yaml")
    everywhere = np.rad2deg(configurations_of(loaded, loaded.experiment.campaigns["validation"], {}))
    lowest = np.rad2deg(np.arcsin(-0.4 / 0.8))
    kept = everywhere[everywhere[:, 1] > lowest]
    assert len(kept) < 50
    np.testing.assert_allclose(above[: len(kept)], kept, rtol=IDENTITY)
    assert (above[:, 1] > lowest - 0.2).all()


def test_a_list_below_the_floor_is_refused_with_every_index(shop):
    shop.change("controller:", "floor_m: 0\ncontroller:", file="arm.yaml")
    each = r"2 of 3 configurations are out of reach\n  configuration 1: .*\n  configuration 3: it reaches"
    with pytest.raises(SettingsError, match=each):
        _angles_deg(shop, "{list_deg: [[20, -50], [20, 0], [0, -59]]}")


def test_a_robot_below_the_floor_gives_up_drawing(shop):
    shop.change("controller:", "floor_m: 3\ncontroller:", file="arm.yaml")
    with pytest.raises(SettingsError, match="only 0 of 500 drawn"):
        _angles_deg(shop, "{random: {count: 5}}")


def test_several_designs_are_measured_in_a_row(shop):
    shop.change("designs:\n", "designs:\n  other: {campaign: candidates, count: 3}\n")
    shop.change("configurations: {from: best}", "configurations: {join: [{from: [other, best]}, {list_deg: [[1, 2]]}]}")
    assert shop.robid("run", "small.yaml").code == 0
    designs = [
        design_from_artifact(read_artifact(shop.runs / f"designs/{name}.h5", DESIGN)) for name in ("other", "best")
    ]
    expected = [*(design.configurations[design.chosen] for design in designs), np.deg2rad([[1, 2]])]
    found = excitation_from_artifact(read_artifact(shop.runs / "estimation/excitation.h5", EXCITATION)).configurations
    np.testing.assert_array_equal(found, np.concatenate(expected))


def test_a_circle_through_one_of_several_designs_is_told(shop):
    shop.change(
        "configurations: {random: {count: 6, seed: 1}}", "configurations: {join: [{list_deg: [[0, 0]]}, {from: best}]}"
    )
    answer = shop.robid("run", "small.yaml")
    assert answer.code == 2
    assert "go in a circle: candidates -> candidates" in answer.flat
