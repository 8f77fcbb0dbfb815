"""The real axis: limits about what is published, and what is told where the log is not there."""

from pathlib import Path

import pytest

from robid.pipeline.graph import Run
from robid.settings.yaml import load_yaml
from robid.studies.janot2009.recorded import EMPS, asked_of
from robid.studies.settings.study import load_with_study

ROOT = Path(__file__).parents[4]


@pytest.fixture
def run(tmp_path):
    return Run(load_with_study(ROOT / "configs/studies/janot2009.yaml"), tmp_path, "serial", 1)


def test_limits_are_those_of_the_published_values():
    asked = asked_of(load_yaml(ROOT / "data/emps.yaml").data)
    assert asked["emps.M"].is_reached(95.1089 * 1.009)
    assert not asked["emps.M"].is_reached(95.1089 * 1.011)
    assert asked["emps.offset"].is_reached(-3.1648 * 1.019)
    assert not asked["emps.offset"].is_reached(-3.1648 * 0.979)
    assert asked["emps.relative_error_percent"].is_reached(4.0834 + 0.09)
    assert not asked["emps.asymmetric_relative_error_percent"].is_reached(3.1117 + 0.11)


def test_without_its_log_the_axis_is_left_out_with_the_reason(run, monkeypatch, tmp_path):
    monkeypatch.setenv("ROBID_DATA", str(tmp_path))
    assert EMPS.further(run, EMPS.case_of(run)) == ()
    found = EMPS.conclude(run, EMPS.case_of(run), ())
    assert found.figures == {}
    assert found.asked == {}
    assert "DATA_EMPS.mat" in found.warnings[0]


def test_with_its_log_both_fits_are_asked_for(run, data_folder):
    data_folder("emps")
    ((own, outputs),) = EMPS.further(run, EMPS.case_of(run))
    assert outputs == ("fits/axis/model.h5", "fits/asymmetric/model.h5")
    assert own.folder == run.folder / "emps"
