"""The examples of the documentation, checked as they would be before their first row."""

import math
from pathlib import Path

from robid.fleet.rows import load_fleet
from robid.studies.settings.study import load_with_study

_FOLDER = Path(__file__).parents[3] / "configs/fleet"


def test_the_example_is_a_fleet_of_different_robots():
    fleet = load_fleet(_FOLDER / "robots.csv", _FOLDER / "arm.yaml")
    assert len({planned.settings_hash for planned in fleet.rows}) == len(fleet.rows) > 2
    assert fleet.experiment.name == "arms"


def test_logs_are_read_as_the_study_writes_them(tmp_path):
    (tmp_path / "manifest.csv").write_text("id,log,payload_kg\nr1,logs/r1.mat,5\n")
    read = load_fleet(tmp_path / "manifest.csv", _FOLDER / "logs.yaml").experiment.campaigns["log"]
    study = load_with_study(_FOLDER.parent / "studies/fleet.yaml").experiment
    written = study.campaigns[study.study.campaign]
    for key in ("configurations", "excitation", "realizations"):
        assert getattr(read, key) == getattr(written, key)
    assert read.periods < written.periods
    imperfections = written.source.simulate.imperfections
    assert {imperfections.encoder_resolution_rad} == {
        2 * math.pi / one.counts_per_turn for one in read.source.acquire.outputs
    }
