"""A position-dependent fit of the small arm: what it refuses, and how its model is read again."""

import shutil

import numpy as np
import pytest
from scipy.io import loadmat

from robid.errors import ArtifactError, DataError
from robid.families.lpv import evaluate
from robid.fit.lpv.state_space import MATRICES

OLD = "elastic: {family: elastic, from: estimation, validate_on: validation, starts: 2}"
FIT = (
    "own: {family: lpv, from: estimation, validate_on: validation, scheduling: [lift], choose_on: [3], inputs: [turn],"
    " outputs: [turn], order: 3, basis: {degree: 2}, path: {count: 2, smallest: 10}}"
)
PLACES = ("configurations: {from: best}", "configurations: {list_deg: [[20, 0], [20, 30], [20, 50], [20, 10]]}")


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Where the runs of the first test go, for the others."""
    return tmp_path_factory.mktemp("lpv") / "runs"


@pytest.fixture
def made(shop, finished):
    shop.change(OLD, FIT)
    shop.change(*PLACES)
    if finished.exists():
        shutil.copytree(finished, shop.folder / "runs")
        return shop
    answer = shop.robid("run", "small.yaml")
    assert answer.code == 0, answer.err
    shutil.copytree(shop.folder / "runs", finished)
    return shop


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("degree: 2", "degree: 3", "3 positions cannot tell 4 basis functions apart"),
        ("choose_on: [3]", "choose_on: [0]", "The model holds from 0.174533 to 0.872665, not at 0"),
        ("choose_on: [3]", "choose_on: [0, 1, 2, 3]", "leaves no configuration to fit"),
        ("choose_on: [3]", "choose_on: [7]", "names no configuration that the fit reads"),
        ("order: 3", "order: 5", " rad: The local model has a pole of absolute value"),
    ],
)
def test_data_that_cannot_be_fitted_are_refused(made, old, new, told):
    made.change(old, new)
    made.refuse(4, "fits.own", told)


def test_a_validation_outside_the_range_is_refused(made):
    made.change("[20, 50]", "[20, 25]")
    made.change("[[20, 30]]", "[[20, 60]]")
    answer = made.robid("run", "small.yaml")
    assert answer.code == 4
    assert "The model holds from 0 to 0.523599, not at 1.0472" in answer.flat


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("scheduling: [lift]", "scheduling: [left]", "there is no joint or output `left`; did you mean `lift`?"),
        ("scheduling: [lift]", "scheduling: [lift, lift]", "is there twice"),
        ("outputs: [turn]", "outputs: [torn]", "campaign `estimation` has no output `torn`"),
        ("choose_on: [3]", "choose_on: estimation", "names the only campaign in `from`"),
        ("choose_on: [3]", "choose_on: validation", "none of the campaigns in `from`"),
        ("choose_on: [3]", "choose_on: [3], configurations: [0, 1, 2]", "is 3, which is none of `configurations`"),
        ("order: 3", "order: 3, integrators: [1, 2]", "has 2 counts for 1 outputs"),
        ("order: 3", "order: 3, integrators: [-1]", "has a count below 0"),
        ("degree: 2", "degree: 2, center: [0, 0]", "has 2 values for 1 scheduling parameters"),
    ],
)
def test_settings_that_do_not_fit_are_refused(made, old, new, told):
    made.change(old, new)
    made.refuse(2, "fits.own", told)


def test_every_file_holds_the_same_model(made, tmp_path):
    folder = made.runs / "fits" / "own"
    for name in ("json", "hdf5", "mat"):
        assert made.robid("export", "small.yaml", "--format", name).code == 0
    points = np.array([[0.0], [0.4], [0.87]])
    own = evaluate(folder / "model.h5")
    for name in ("lpv.json", "lpv.h5"):
        again = evaluate(str(folder / "export" / name))
        assert again.sampling_period_s == own.sampling_period_s
        for matrix in MATRICES:
            np.testing.assert_array_equal(getattr(again.at(points), matrix), getattr(own.at(points), matrix))
    written = loadmat(folder / "export" / "lpv.mat")
    reduced = (0.4 - written["center"].item()) / written["scale"].item()
    A = sum(written[f"A_{power}"] * reduced**power for power in range(3))
    np.testing.assert_allclose(A, own.at(points).A[1], rtol=1e-12)
    with pytest.raises(DataError, match="The model holds from"):
        own.at(np.array([[1.0]]))
    (tmp_path / "other.json").write_text("{}")
    with pytest.raises(ArtifactError, match="no position-dependent model"):
        evaluate(tmp_path / "other.json")
