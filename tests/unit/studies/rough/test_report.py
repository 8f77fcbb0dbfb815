"""Figures of the study from fits and cut-offs whose errors are known."""

from pathlib import Path

import numpy as np
import pytest

from robid.artifacts.artifact import Artifact, Dataset, Provenance
from robid.artifacts.kinds import TASK
from robid.artifacts.store import write_artifact
from robid.studies.rough.individuals import enough, populations
from robid.studies.rough.report import cut_off_figures, grade_figures, read_fits
from robid.studies.settings.study import load_with_study
from robid.studies.study import Results

ROOT = Path(__file__).parents[4]

# Validated, then one motion: true errors of two motors, their bounds, and the grade.
ROBOTS = [
    (((0.05, 0.09), (0.1, 0.1), 1), ((0.02, 0.04), (0.05, 0.05), 1)),
    (((0.05, 0.02), (0.1, 0.1), 0), ((0.08, 0.10), (0.16, 0.05), 0)),
    (((0.09, 0.01), (0.1, 0.1), 2), ((0.10, 0.50), (0.20, 0.60), 1)),
    (((0.10, 0.31), (0.1, 0.1), 0), ((0.01, 0.90), (0.05, 1.80), 1)),
    (((0.20, 0.05), (0.1, 0.1), 1), ((np.nan, np.nan), (np.nan, np.nan), 0)),
]


def held(number, fits):
    error, bound, grade = (np.array([fit[key] for fit in fits]) for key in range(3))
    datasets = {
        **{"error": Dataset(error, "1", ("fit", "joint")), "bound": Dataset(bound, "1", ("fit", "joint"))},
        **{"grade": Dataset(grade, "1", ("fit",)), "cut": Dataset(np.ones(2), "Hz", ("fit",))},
        "sentence": Dataset(np.array(["said", "said"]), "1", ("fit",)),
    }
    return Artifact(TASK, datasets, {"arm": "heavy", "seed": number}, Provenance(stage="study"))


@pytest.fixture
def results():
    return [held(number, fits) for number, fits in enumerate(ROBOTS)]


def test_grades_and_bounds_are_counted_by_the_true_errors(results):
    found = grade_figures(read_fits(results))
    assert found["rough.refused"] == pytest.approx(1 / 3)  # of three good ones
    assert found["rough.one_motion_refused"] == pytest.approx(1 / 2)
    assert found["rough.let_through"] == 2
    assert found["rough.validated.let_through"] == 0
    assert found["rough.expected_error"] == pytest.approx(7 / 8)  # 0.10 is beyond 0.05; what was refused counts not
    assert found["rough.expected_width"] == pytest.approx(np.median([2.5, 1.25, 2, 0.5, 2, 1.2, 5, 2]))
    assert found["rough.one_motion.unfitted"] == 1
    counts = populations(results)
    assert counts == {"validated.good": 3, "validated.bad": 1, "one_motion.good": 2, "one_motion.bad": 2}


def test_where_no_bound_is_stated_none_is_judged():
    fits = tuple((error, (np.nan, np.nan), grade) for error, _, grade in ROBOTS[0])
    found = grade_figures(read_fits([held(0, fits)]))
    assert not {"rough.expected_error", "rough.expected_width"} & set(found)


def test_robots_are_added_while_good_or_bad_fits_of_either_kind_are_too_few(results):
    study = load_with_study(ROOT / "configs/studies/rough.yaml").experiment.study
    counts = populations(results)
    assert enough(study.model_copy(update={"good": 2, "bad": 1}), counts)
    assert not enough(study.model_copy(update={"good": 3, "bad": 1}), counts)
    assert not enough(study.model_copy(update={"good": 2, "bad": 2}), counts)


def test_the_loss_is_that_of_held_out_errors_against_the_best_constant_cut_off(tmp_path):
    errors = {
        "arm": [[0.06, 0.10], [0.05, 0.05], [0.04, 0.04]],
        "log": [[0.02, 0.02], [np.inf, 0.01], [0.04, 0.04]],
    }
    paths = []
    for name, error in errors.items():
        cut = np.array([[8.0, 12.0], [5.0, 5.0], [20.0, 20.0]])
        known = np.array([[0.3, 0.1], [0.2, 0.2], [0.1, 0.1]]) if name == "arm" else np.full((3, 2), np.nan)
        axes = ("trial", "fold")
        values = {"cut": (cut, "Hz"), "error": (np.array(error), "1"), "parameters": (known, "1")}
        datasets = {key: Dataset(*value, axes) for key, value in values.items()}
        paths.append(tmp_path / f"{name}.{len(paths)}.h5")
        write_artifact(paths[-1], Artifact(TASK, datasets, {}, Provenance(stage="study")), alone=False)
    found = cut_off_figures(Results(tuple(paths)))
    assert found["cutoff.arm.loss"] == pytest.approx(2.0)
    assert found["cutoff.log.loss"] == pytest.approx(0.5)
    assert found["cutoff.loss"] == pytest.approx(2.0)
    assert (found["cutoff.arm.automatic_hz"], found["cutoff.arm.best_hz"]) == (10, 20)
    assert (found["cutoff.arm.parameters"], found["cutoff.arm.best_parameters"]) == pytest.approx((0.2, 0.1))
    assert "cutoff.log.parameters" not in found
