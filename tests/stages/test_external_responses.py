"""Transfer functions of responses alone: known plants come back, exports are the model, refusals are by name."""

import json

import numpy as np
import pytest
import yaml
from scipy import signal

import robid
from robid.artifacts.results import MODEL, VALIDATION
from robid.artifacts.store import read_artifact
from robid.models.external.of_responses.files import solution_from_artifact, validation_from_artifact

FREQUENCY = np.geomspace(1, 200, 120)
NOISE = 0.01


def plant(frequency_hz, resonance_hz=30.0, gain=50.0):
    """Two masses on a spring: torque to the angle of the first, 2 ms late."""
    s, w, z = 2j * np.pi * frequency_hz, 2 * np.pi * resonance_hz, 2 * np.pi * 18
    return gain / s**2 * (1 + 0.02 * s / z + s**2 / z**2) / (1 + 0.04 * s / w + s**2 / w**2) * np.exp(-0.002 * s)


def write(path, elements, seed, frequency=FREQUENCY):
    """A table of elements by `output per input`, with noise of one per cent and its deviation."""
    generator, columns = np.random.default_rng(seed), {"f": frequency}
    for name, response in elements.items():
        std = NOISE * np.abs(response)
        error = (generator.normal(size=(2, response.size)).T @ [1, 1j]) * std / np.sqrt(2)
        measured = response + error
        columns |= {f"{name} real": measured.real, f"{name} imaginary": measured.imag, f"{name} deviation": std}
    rows = [",".join(columns), *(",".join(map(repr, row)) for row in np.transpose(list(columns.values())).tolist())]
    path.write_text("\n".join(rows))


def experiment(folder, fit, outputs=("axis",), inputs=("axis",), **more):
    source = {
        "inputs": [{"name": name, "variable": name, "unit": "N m"} for name in inputs],
        "outputs": [{"name": name, "variable": name, "unit": "rad"} for name in outputs],
        **more,
    }
    content = {
        "schema_version": 2,
        "name": "plain",
        "campaigns": {
            name: {"source": {"response": {"file": f"{name}.csv", **source}}, "estimate": {"outputs": "measured"}}
            for name in ("own", "other")
        },
        "fits": {"tf": {"family": "external", "from": "own", **fit}},
        "execution": {"backend": "serial"},
    }
    (folder / "plain.yaml").write_text(yaml.safe_dump(content))


@pytest.fixture
def bench(shop):
    """Two measurements of one plant."""
    write(shop.folder / "own.csv", {"axis per axis": plant(FREQUENCY)}, 1)
    write(shop.folder / "other.csv", {"axis per axis": plant(FREQUENCY)}, 2)
    experiment(shop.folder, {"validate_on": "other"})
    return shop


def values(shop):
    found = solution_from_artifact(read_artifact(shop.folder / "runs/plain/fits/tf/model.h5", MODEL)).estimate
    return {name: (low, high) for name, low, high in zip(found.names, found.lower, found.upper, strict=True)}


def test_a_plant_comes_back_with_its_structure_and_is_trusted(bench):
    answer = bench.robid("run", "plain.yaml")
    assert answer.code == 0, answer.err
    found = solution_from_artifact(read_artifact(bench.folder / "runs/plain/fits/tf/model.h5", MODEL))
    own = found.transfers
    assert (own.poles.tolist(), own.zeros.tolist(), own.integrators.tolist()) == ([4], [2], [2])
    truth = {
        "axis.pole1.frequency": 2 * np.pi * 30,
        "axis.pole1.damping": 0.02,
        "axis.zero1.frequency": 2 * np.pi * 18,
        "axis.zero1.damping": 0.01,
        "axis.gain_per_second": 50.0,
        "axis.delay": 0.002,
    }
    bounds = values(bench)
    assert bounds.keys() == truth.keys()
    for name, value in truth.items():
        low, high = bounds[name]
        # Four standard deviations on either side.
        assert abs(value - (low + high) / 2) < 2.1 * (high - low) / 2, name
        assert high - low < 0.2 * value
    assert 0.5 < found.quality.cost[0] / found.quality.degrees_of_freedom[0] < 1.5
    validation = validation_from_artifact(read_artifact(bench.folder / "runs/plain/fits/tf/validation.h5", VALIDATION))
    assert validation.outcome.grade.value == 2
    np.testing.assert_allclose(validation.shown.model[:, 0], plant(FREQUENCY), rtol=0.01)
    assert "known by its responses alone" in (bench.folder / "runs/plain/report.html").read_text()
    stored = robid.open(bench.folder / "runs/plain").fits["tf"]
    assert stored.residual.labels == ("axis",)
    assert 0.7 < np.mean(np.abs(stored.residual.whitened) ** 2) < 1.3
    np.testing.assert_array_equal(stored.residual.measured[:, 0], stored.responses.response[0, :, 0, 0])


def test_exports_are_the_model(bench):
    assert bench.robid("run", "plain.yaml").code == 0
    assert bench.robid("export", "plain.yaml", "--fit", "tf", "--format", "json").code == 0
    (path,) = (bench.folder / "runs/plain").rglob("transfer.json")
    (channel,) = json.loads(path.read_text())["channels"]
    omega = 2 * np.pi * FREQUENCY
    _, response = signal.freqs(channel["numerator"], channel["denominator"], omega)
    late = response * np.exp(-1j * omega * channel["delay_s"])
    np.testing.assert_allclose(late, plant(FREQUENCY), rtol=0.01)


def test_a_matrix_has_common_poles(shop):
    names = {"axis per axis": (30.0, 50.0), "axis per other": (30.0, -7.0)}
    names |= {"other per axis": (30.0, 3.0), "other per other": (30.0, 20.0)}
    for file, seed in (("own", 3), ("other", 4)):
        write(shop.folder / f"{file}.csv", {name: plant(FREQUENCY, *at) for name, at in names.items()}, seed)
    channels = ("axis", "other")
    experiment(shop.folder, {"matrix": "full", "validate_on": "other"}, channels, channels)
    answer = shop.robid("run", "plain.yaml")
    assert answer.code == 0, answer.err
    found = solution_from_artifact(read_artifact(shop.folder / "runs/plain/fits/tf/model.h5", MODEL))
    assert (found.transfers.poles.tolist(), found.transfers.integrators.tolist()) == ([4], [2])
    expected = np.stack([plant(FREQUENCY, *at) for at in names.values()], axis=1)
    np.testing.assert_allclose(found.shown.model, expected, rtol=0.02)
    low, high = values(shop)["matrix.pole1.frequency"]
    assert low < 2 * np.pi * 30 * 1.001
    assert high > 2 * np.pi * 30 / 1.001


def test_functions_in_z_of_a_sampled_response(shop):
    period, lines = 0.002, np.linspace(2, 240, 120)
    pair = 0.97 * np.exp(0.4j)
    above, below = [0.1, 0.05], np.poly([pair, pair.conj(), 0.9]).real
    _, response = signal.freqz([0, 0, *above], below, 2 * np.pi * lines * period)
    for file, seed in (("own", 5), ("other", 6)):
        write(shop.folder / f"{file}.csv", {"axis per axis": response}, seed, lines)
    experiment(shop.folder, {"time": "discrete"}, sampling_period_s=period)
    answer = shop.robid("run", "plain.yaml")
    assert answer.code == 0, answer.err
    found = solution_from_artifact(read_artifact(shop.folder / "runs/plain/fits/tf/model.h5", MODEL))
    np.testing.assert_allclose(found.transfers.response(0, lines, period), response, rtol=0.02)
    np.testing.assert_allclose(found.shown.model[:, 0], response, rtol=0.02)


def test_another_plant_is_not_predicted(bench):
    write(bench.folder / "other.csv", {"axis per axis": plant(FREQUENCY, resonance_hz=33)}, 7)
    answer = bench.robid("run", "plain.yaml")
    assert answer.code == 5
    validation = validation_from_artifact(read_artifact(bench.folder / "runs/plain/fits/tf/validation.h5", VALIDATION))
    assert validation.outcome.grade.value == 0
    assert not validation.outcome.ok


@pytest.mark.parametrize(
    ("cause", "factor", "stretch"),
    [
        ("angle_sign", -1.0, 1.0),
        ("units", 180 / np.pi, 1.0),
        ("units", 1.0, 2 * np.pi),
        ("units", 1.0, 1 / (2 * np.pi)),
    ],
)
def test_a_validation_with_a_mistake_is_blamed_for_it(bench, cause, factor, stretch):
    """A reversed sign, degrees for radians, and frequencies in the other unit: each is said first."""
    write(bench.folder / "other.csv", {"axis per axis": factor * plant(FREQUENCY)}, 8)
    lines = (bench.folder / "other.csv").read_text().splitlines()
    rows = [line.partition(",") for line in lines[1:]]
    moved = [f"{float(first) * stretch!r},{rest}" for first, _, rest in rows]
    (bench.folder / "other.csv").write_text("\n".join([lines[0], *moved]))
    assert bench.robid("run", "plain.yaml").code == 5
    validation = validation_from_artifact(read_artifact(bench.folder / "runs/plain/fits/tf/validation.h5", VALIDATION))
    assert validation.outcome.grade.value == 0
    assert validation.outcome.grade.causes[0] == cause


@pytest.mark.parametrize(
    ("code", "fit", "more"),
    [
        ("S623", {"choose_on": "other", "from": ["own", "other"]}, {}),
        ("S621", {"poles": 3, "zeros": 4}, {}),
        ("S622", {"relative_degree": -1, "time": "discrete"}, {}),
        ("D639", {"time": "discrete"}, {}),
        ("D640", {"poles": 12, "max_poles": 12}, {"cut": 6}),
        ("S066", {"pairs": [["axis", "lift"]]}, {}),
    ],
)
def test_what_cannot_be_is_refused_by_name(bench, code, fit, more):
    if "cut" in more:
        lines = (bench.folder / "own.csv").read_text().splitlines()
        (bench.folder / "own.csv").write_text("\n".join(lines[: more["cut"]]))
    experiment(bench.folder, fit)
    answer = bench.robid("run", "plain.yaml")
    assert answer.code in (2, 3, 4), answer.out
    assert code in answer.err


def test_records_and_responses_are_fitted_apart(bench):
    content = yaml.safe_load((bench.folder / "plain.yaml").read_text())
    content["campaigns"]["other"]["source"] = {
        "acquire": {
            "file": "log.csv",
            "sampling_period_s": 0.001,
            "one_shot": True,
            "inputs": [{"name": "axis", "variable": "u"}],
            "outputs": [{"name": "axis", "variable": "y"}],
        }
    }
    content["fits"]["tf"] = {"family": "external", "from": ["own", "other"]}
    (bench.folder / "plain.yaml").write_text(yaml.safe_dump(content))
    answer = bench.robid("run", "plain.yaml")
    assert answer.code == 2
    assert "S620" in answer.err


def test_responses_of_a_fleet_are_rows_and_stay_in_their_folder(bench):
    """Each row names a file of responses; one that leads out of the folder through a link is refused."""
    experiment(bench.folder, {})
    text = (bench.folder / "plain.yaml").read_text().replace("file: own.csv", "file: ${row.file}")
    (bench.folder / "plain.yaml").write_text(text)
    (bench.folder / "rows.csv").write_text("id,file\none,own.csv\ntwo,other.csv\n")
    answer = bench.robid("reprocess", "rows.csv", "plain.yaml")
    assert answer.code == 0, answer.err
    outside = bench.folder.parent / "outside.csv"
    outside.write_text((bench.folder / "own.csv").read_text())
    (bench.folder / "link.csv").symlink_to(outside)
    (bench.folder / "rows.csv").write_text("id,file\nthree,link.csv\n")
    answer = bench.robid("reprocess", "rows.csv", "plain.yaml")
    assert answer.code == 2
    assert "through a link" in answer.flat
