"""The example of the documentation, checked as it would be before its first row."""

from pathlib import Path

from robid.fleet.rows import load_fleet

_FOLDER = Path(__file__).parents[3] / "configs/fleet"


def test_the_example_is_a_fleet_of_different_robots():
    fleet = load_fleet(_FOLDER / "robots.csv", _FOLDER / "arm.yaml")
    assert len({planned.settings_hash for planned in fleet.rows}) == len(fleet.rows) > 2
    assert fleet.experiment.name == "arms"
