"""A position-dependent fit of the small arm: what it refuses, and how its model is read again."""

import json
import shutil

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.io import loadmat

from robid.errors import ArtifactError, DataError
from robid.models.lpv.family import evaluate
from robid.models.lpv.fit.state_space import MATRICES

OLD = "elastic: {family: elastic, from: estimation, validate_on: validation, starts: 2}"
FIT = (
    "own: {family: lpv, from: estimation, validate_on: validation, scheduling: [lift], choose_on: [4], inputs: [turn],"
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
        ("choose_on: [4]", "choose_on: [1]", "lift = 0°: D176 The model is valid from lift = 10° to lift = 50°"),
        ("order: 3", "order: 7", "too few for 7 states. remedy: Measure more lines, or lower `order` to 6 at most"),
        ("order: 3", "order: 5", "°: D172"),
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
    assert "lift = 60°: D176 The model is valid from lift = 0° to lift = 30°" in answer.flat


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("scheduling: [lift]", "scheduling: [left]", "there is no joint or output `left`; did you mean `lift`?"),
        ("scheduling: [lift]", "scheduling: [lift, lift]", "is there twice"),
        ("outputs: [turn]", "outputs: [torn]", "campaign `estimation` has no output `torn`"),
        (
            "inputs: [turn]",
            "inputs: [turn, torn]",
            "fits.own.inputs[2]: S076 campaign `estimation` has no input `torn`",
        ),
        ("inputs: [turn]", "inputs: [turn, turn]", "fits.own.inputs[2]: S077 `turn` is there twice"),
        ("choose_on: [4]", "choose_on: [4, 8]", "fits.own.choose_on[2]: S081 there is no configuration 8"),
        ("choose_on: [4]", "choose_on: [1, 2, 3, 4]", "S082"),
        ("choose_on: [4]", "choose_on: estimation", "names the only campaign in `from`"),
        ("choose_on: [4]", "choose_on: validation", "S078"),
        ("choose_on: [4]", "choose_on: [4], configurations: [1, 2, 3]", "is 4, which is none of `configurations`"),
        ("order: 3", "order: 3, integrators: [1, 2]", "has 2 counts for 1 outputs"),
        ("order: 3", "order: 3, integrators: [-1]", "S074"),
        ("degree: 2", "degree: 3", "fits.own.basis: S083 3 positions cannot tell 4 functions apart"),
        ("degree: 2", "kind: splines", "fits.own.basis: S083 3 positions cannot tell 6 functions apart"),
        ("scheduling: [lift]", "scheduling: [turn, lift]", "3 positions cannot tell 6 functions apart"),
        ("degree: 2", "degree: 2, center: [0, 0]", "has 2 values for 1 scheduling parameters"),
    ],
)
def test_settings_that_do_not_fit_are_refused(made, old, new, told):
    made.change(old, new)
    made.refuse(2, "fits.own", told)


def test_every_file_holds_the_same_model(made):
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
    with pytest.raises(DataError, match="D166"):
        own.at(np.array([[1.0]]))


TWO = (
    "configurations: {list_deg: [[0, 20], [0, 40], [40, 20], [40, 40], [10, 35]]}",
    FIT.replace("[lift]", "[turn, lift]").replace("[3]", "[4]"),
)


def powers(written, points):
    reduced = (points - written["center"].ravel()) / written["scale"].ravel()
    return [np.prod(reduced**each, axis=1) for each in written["exponents"]]


def splines(written, points):
    hats = [
        [BSpline.basis_element(knots[index : index + 3])(column) for index in range(2)]
        for knots, column in zip(written["knots"], points.T, strict=True)
    ]
    return [first * second for first in hats[0] for second in hats[1]][1:]


@pytest.mark.parametrize(
    ("basis", "names", "functions"),
    [
        pytest.param("degree: 1", ["p1", "p2"], powers, marks=pytest.mark.slow),
        ("kind: splines, degree: 1, pieces: 1", ["spline 1,2", "spline 2,1", "spline 2,2"], splines),
    ],
)
def test_functions_of_two_angles_go_through_every_file(shop, basis, names, functions):
    shop.change(OLD, TWO[1].replace("degree: 2", basis))
    shop.change(PLACES[0], TWO[0])
    answer = shop.robid("run", "small.yaml")
    assert answer.code == 0, answer.err
    for name in ("json", "hdf5", "mat"):
        assert shop.robid("export", "small.yaml", "--format", name).code == 0
    folder = shop.runs / "fits" / "own"
    points = np.radians([[10.0, 25.0], [20.0, 35.0], [39.0, 39.5]])
    own = evaluate(folder / "model.h5")
    assert list(own.basis.functions.names) == names
    for name in ("lpv.json", "lpv.h5"):
        again = evaluate(folder / "export" / name).at(points)
        for matrix in MATRICES:
            np.testing.assert_array_equal(getattr(again, matrix), getattr(own.at(points), matrix))
    written = loadmat(folder / "export" / "lpv.mat")
    for matrix in MATRICES:
        values = [np.ones(3), *functions(written, points)]
        summed = sum(value[:, None, None] * written[f"{matrix}_{index}"] for index, value in enumerate(values))
        np.testing.assert_allclose(summed, getattr(own.at(points), matrix), rtol=1e-9, atol=1e-12)


def test_a_file_that_holds_no_whole_model_is_refused_by_name(made, tmp_path):
    folder = made.runs / "fits" / "own"
    for name in ("json", "hdf5"):
        assert made.robid("export", "small.yaml", "--format", name).code == 0
    text = (folder / "export" / "lpv.json").read_text()
    whole = (folder / "export" / "lpv.h5").read_bytes()
    content = json.loads(text)
    broken = {
        "empty.json": (b"{}", "no position-dependent model"),
        "list.json": (b"[1]", "no position-dependent model"),
        "cut.json": (text[:500].encode(), "it is no JSON"),
        "latin.json": (b'{"robot": "\xe4"}', "it is no JSON"),
        "newer.json": (text.replace("robid lpv 1", "robid lpv 9").encode(), "its format is `robid lpv 9`"),
        "without.json": (json.dumps({**content, "A": None}).encode(), "do not make a model"),
        "shapes.json": (json.dumps({**content, "B": content["B"][:1]}).encode(), "do not make a model"),
        "fewer.json": (json.dumps({key: content[key] for key in content if key != "C"}).encode(), "it has no `C`"),
        "infinite.json": (json.dumps({**content, "scale": [None]}).encode(), "do not make a model"),
        "timeless.json": (json.dumps({**content, "sampling_period_s": 0}).encode(), "do not make a model"),
        "turned.json": (
            json.dumps({**content, "lower": content["upper"], "upper": content["lower"]}).encode(),
            "do not",
        ),
        "cut.h5": (whole[: len(whole) // 2], "damaged|no position-dependent model"),
        "text.h5": (b"hello", "no position-dependent model"),
        "frf.h5": ((made.runs / "estimation" / "frf.h5").read_bytes(), "no position-dependent model"),
        "model.h5": ((folder / "model.h5").read_bytes()[:-20000], "damaged|no position-dependent model"),
    }
    for name, (bytes_, told) in broken.items():
        path = tmp_path / name
        path.write_bytes(bytes_)
        with pytest.raises(ArtifactError, match=told) as caught:
            evaluate(path)
        assert name in str(caught.value)
        assert "remedy" in str(caught.value)
    with pytest.raises(ArtifactError, match="there is no such file"):
        evaluate(tmp_path / "nowhere.json")
