"""Every family through everything that a user can do with a fit; one of the test's own among them."""

import json
import re
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import pytest
from rich.text import Text
from ruamel.yaml import YAML

import robid
from robid.artifacts.results import (
    MODEL,
    VALIDATION,
    estimate_from_artifact,
    grade_from_artifact,
    outcome_from_artifact,
)
from robid.artifacts.store import read_artifact, write_artifact
from robid.artifacts.truth import read_truth
from robid.later import imported
from robid.models import known as files
from robid.models.family import Family
from robid.models.known import FAMILIES, experiment_schema, load_experiment
from robid.models.lpv.fit.options import BasisOptions, PathOptions
from robid.models.rigid.fit.options import PreprocessingOptions
from robid.models.values import FITS
from robid.pipeline.chain import CHAIN
from robid.pipeline.graph import graph
from robid.pipeline.report import gather
from robid.settings.robot_parts import plain_settings
from terminals import ask_in_terminal, left_out, numbers, screen, widest
from toy_family import INERTIA

CHROMIUM = next((found for name in ("chromium", "chromium-browser") if (found := shutil.which(name))), None)


@dataclass(frozen=True)
class Case:
    family: Family
    fit: str
    change: tuple[str, str]
    section: str
    left_out: tuple[str, ...] = ()
    swaps: tuple[tuple[str, str], ...] = ()  # what the experiment has otherwise for this family
    code: int = 0  # what a run exits with: 5 where the model is not to be used


CASES = {
    "elastic": Case(
        FAMILIES["elastic"],
        "{family: elastic, from: estimation, validate_on: validation, starts: 2}",
        ("starts: 2", "starts: 1"),
        "Frequency response",
    ),
    "rigid": Case(
        FAMILIES["rigid"],
        "{family: rigid, from: estimation, validate_on: validation, instruments: none, filters: {position_cut_hz: 60}}",
        ("position_cut_hz: 60", "position_cut_hz: 50"),
        "Least squares against other estimators",
        ("estimation/frf.h5", "validation/frf.h5"),
        code=5,  # small motions of an elastic arm
    ),
    "external": Case(
        FAMILIES["external"],
        "{family: external, from: estimation, validate_on: validation, poles: 3, zeros: 2, delay_samples: 1}",
        ("delay_samples: 1", "delay_samples: 2"),
        "Parameters",
        ("estimation/frf.h5", "validation/frf.h5"),
        code=5,  # two places with other resonances, one model
    ),
    "lpv": Case(
        FAMILIES["lpv"],
        "{family: lpv, from: estimation, validate_on: validation, scheduling: [lift], choose_on: [5], inputs: [turn],"
        " outputs: [turn], order: 3, basis: {degree: 2}, path: {count: 2, smallest: 10}}",
        ("count: 2, smallest", "count: 3, smallest"),
        "Regularisation path",
        swaps=(
            (
                "configurations: {from: best}",
                "configurations: {list_deg: [[20, 0], [20, 20], [20, 40], [20, 60], [20, 10]]}",
            ),
        ),
    ),
    "transmission": Case(
        FAMILIES["transmission"],
        "{family: transmission, from: estimation, validate_on: validation, cut_hz: 60}",
        ("cut_hz: 60", "cut_hz: 50"),
        "Torque over deflection",
        ("estimation/frf.h5", "validation/frf.h5"),
        swaps=(
            ("nominal}\n  validation:", "nominal}\n    outputs: [motors, turn.arm, lift.arm]\n  validation:"),
            ("nominal}\ndesigns:", "nominal}\n    outputs: [motors, turn.arm, lift.arm]\ndesigns:"),
        ),
    ),
    "inertia": Case(
        INERTIA,
        "{family: inertia, from: estimation, validate_on: validation}",
        ("validate_on: validation}", "validate_on: validation, shrink: 0.1}"),
        "What the motors move",
        ("estimation/frf.h5", "validation/frf.h5"),
    ),
}


@pytest.fixture(params=CASES, autouse=True)
def case(request, shop, monkeypatch):
    found = CASES[request.param]
    known: Mapping[str, Family] = {**FAMILIES, found.family.name: found.family}
    monkeypatch.setattr(files, "FAMILIES", known)
    shop.change("elastic: {family: elastic, from: estimation, validate_on: validation, starts: 2}", f"own: {found.fit}")
    for swap in found.swaps:
        shop.change(*swap)
    return found


@pytest.fixture(scope="module")
def finished():
    """Finished runs by the family of their fit, made when first asked for."""
    return {}


@pytest.fixture
def made(shop, case, finished, finished_runs, tmp_path_factory):
    """A folder with a finished run: its campaigns are those of the small experiment wherever they are still fresh."""
    name = case.family.name
    if name in finished:
        shutil.copytree(finished[name], shop.folder / "runs")
        return shop
    shutil.copytree(finished_runs, shop.folder / "runs", ignore=shutil.ignore_patterns("fits", "report.html"))
    for path in case.left_out:
        (shop.runs / path).unlink()
    answer = shop.robid("run", "small.yaml")
    assert answer.code == case.code, answer.err
    finished[name] = shutil.copytree(shop.folder / "runs", tmp_path_factory.mktemp(name) / "runs")
    return shop


def test_every_family_has_a_case():
    assert set(FAMILIES) <= set(CASES)


def test_settings_come_back_and_their_schema_knows_them(shop, case):
    loaded = load_experiment(shop.folder / "small.yaml")
    fit = loaded.experiment.fits["own"]
    assert type(fit) is imported(case.family.settings)
    content = YAML(typ="safe").load((shop.folder / "small.yaml").read_text())
    content["fits"]["own"] = plain_settings(fit)
    content["schema_version"] = 1  # inside, configurations count from 0, as in files of version 1
    with (shop.folder / "again.yaml").open("w") as file:
        YAML(typ="safe").dump(content, file)
    assert load_experiment(shop.folder / "again.yaml").experiment.fits["own"] == fit
    assert imported(case.family.settings).__name__ in experiment_schema()["$defs"]


def test_what_is_wrong_with_a_fit_is_told_with_its_place(shop):
    shop.change("own: {family:", "own: {famly: 1, family:")
    assert "fits.own.famly: S380 unknown key; did you mean `family`?" in shop.refuse(2).flat
    shop.change("famly: 1, ", "")
    shop.change("validate_on: validation", "validate_on: nowhere")
    assert "fits.own.validate_on: S177 there is no campaign `nowhere`" in shop.refuse(2).flat


def test_a_family_that_does_not_exist_is_refused_with_those_that_do(shop, case):
    shop.change(f"family: {case.family.name}", "family: plastic")
    answer = shop.refuse(2, "fits.own.family", "plastic")
    assert all(f"'{name}'" in answer.flat for name in files.FAMILIES)


def test_artifacts_come_back(made, tmp_path):
    for kind in (MODEL, VALIDATION):
        path = made.runs / "fits" / "own" / f"{kind.name}.h5"
        artifact = read_artifact(path, kind)
        write_artifact(tmp_path / path.name, artifact)
        again = read_artifact(tmp_path / path.name, artifact.kind)
        assert again.attributes == artifact.attributes
        assert again.datasets.keys() == artifact.datasets.keys()
        for key, dataset in artifact.datasets.items():
            np.testing.assert_array_equal(again.datasets[key].values, dataset.values)
            assert again.datasets[key].units == dataset.units


def test_every_result_has_the_common_core(made, case):
    folder = made.runs / "fits" / "own"
    model, validation = (read_artifact(folder / f"{kind.name}.h5", kind) for kind in (MODEL, VALIDATION))
    estimate, outcome = estimate_from_artifact(model), outcome_from_artifact(validation)
    assert model.attributes["family"] == validation.attributes["family"] == case.family.name
    assert {name.partition("/")[0] for name in model.datasets} <= {"estimate", "grade", case.family.name}
    assert {name.partition("/")[0] for name in validation.datasets} <= {"outcome", "grade", case.family.name}
    assert len(set(estimate.names)) == len(estimate.names) == len(estimate.units) == estimate.value.size > 0
    middle = estimate.value if estimate.physical_value is None else estimate.physical_value
    assert ((estimate.lower <= middle) & (middle <= estimate.upper)).all()
    deviation = np.sqrt(np.diag(estimate.covariance))
    correlation = estimate.covariance / np.outer(deviation, deviation)
    np.testing.assert_allclose(correlation, correlation.T, atol=1e-9)
    assert np.linalg.eigvalsh(correlation).min() > -1e-9
    known = dict(zip(outcome.recovery.names, outcome.recovery.truth, strict=True))
    values = case.family.true_values(*true_robot_of(made))
    assert known == {name: values[name] for name in estimate.names if name in values}
    assert outcome.grade.sentence
    told = case.family.misfits(model, validation)
    assert set(case.family.misfits(model, None)) < set(told) or not told
    assert np.isfinite(list(told.values())).all()
    assert min(told.values(), default=1.0) > 0
    assert grade_from_artifact(model).value <= 1, "a fit that nothing was held against predicts at best"


def true_robot_of(made):
    loaded = load_experiment(made.folder / "small.yaml")
    return loaded, "own", read_truth(*(made.runs / "estimation" / name for name in ("truth.json", "record.h5")))


def test_a_run_makes_what_is_read_and_the_rest_on_request(made, case):
    loaded = load_experiment(made.folder / "small.yaml")
    outputs = {path for node in graph(loaded) for path in node.plan.outputs}
    states = made.states()
    assert {state for state, _ in states.values()} == {"fresh"}
    there = {str(path.relative_to(made.runs)) for path in made.runs.rglob("*.*") if path.is_file()}
    assert outputs - set(case.left_out) == there
    for path in case.left_out:
        campaign = path.partition("/")[0]
        answer = made.robid("estimate-frf", "small.yaml", "--campaign", campaign)
        assert answer.code == 0, answer.err
        assert (made.runs / path).exists()


def test_a_changed_fit_makes_itself_stale_and_nothing_else(made, case):
    before = made.contents()
    made.change(*case.change)
    stale = {path for path, (state, _) in made.states().items() if state != "fresh"}
    assert stale == {"fits/own/model.h5", "fits/own/validation.h5", "report.html"}
    answer = made.robid("run", "small.yaml")
    assert answer.code in (0, 5), answer.err
    after = made.contents()
    assert {path for path in after if after[path] != before[path]} <= stale
    assert after["fits/own/model.h5"] != before["fits/own/model.h5"]


def test_an_interrupted_fit_loses_nothing_and_is_resumed(made, case, monkeypatch):
    shop, whole = made, files.FAMILIES
    shutil.rmtree(shop.runs / "fits")
    (shop.runs / "report.html").unlink()

    def interrupted(*_):
        raise KeyboardInterrupt

    broken = replace(case.family, fit=interrupted)
    monkeypatch.setattr(files, "FAMILIES", {**whole, case.family.name: broken})
    assert shop.robid("run", "small.yaml").code == 130
    before = shop.contents()
    monkeypatch.setattr(files, "FAMILIES", whole)
    answer = shop.robid("run", "small.yaml", "--json")
    assert answer.code == case.code, answer.err
    outcomes = {node["output"]: node["outcome"] for node in answer.json["nodes"]}
    assert {path for path, outcome in outcomes.items() if outcome == "made"} == {
        "fits/own/model.h5",
        "fits/own/validation.h5",
        "report.html",
    }
    assert {path: digest for path, digest in shop.contents().items() if path in before} == before


def test_every_format_is_written(made, case):
    for name, form in case.family.exports.items():
        answer = made.robid("export", "small.yaml", "--format", name)
        assert answer.code == 0, answer.err
        assert (made.runs / "fits" / "own" / "export" / form.file).stat().st_size > 0
    answer = made.robid("export", "small.yaml", "--format", "stone")
    assert answer.code == 2
    assert all(f"`{name}`" in answer.flat for name in case.family.exports)


def test_the_report_shows_it_and_the_summary_counts_it(made, case, tmp_path):
    summary = json.loads((made.runs / "summary.json").read_text())
    assert any(key.startswith("fits.own.") for key in summary)
    page = made.runs / "report.html"
    shown = page.read_text()
    assert case.section in shown
    assert "Signals against the motors&#39; limits" in shown, "records are there, and the robot file states limits"
    assert ("<h2>Signals in time</h2>" in shown) == (case.family.name == "elastic")
    if CHROMIUM is None:
        pytest.skip("Chromium is not installed: the page was not opened")
    drawing = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
    flags = ("--headless", "--no-sandbox", "--enable-logging=stderr", "--virtual-time-budget=8000", *drawing)
    command = [CHROMIUM, *flags, f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", page.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=90, check=True)
    told = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    assert [line for line in told if "willReadFrequently" not in line] == []
    assert re.search(rf"<h\d[^>]*>\s*(<a[^>]*>)?{case.section}", done.stdout)


IN_MEMORY = {
    "elastic": ("responses", {"starts": 2}),
    "rigid": ("records", {"filters": PreprocessingOptions(position_cut_hz=60), "instruments": "none"}),
    "transmission": ("records", {"cut_hz": 60.0}),
    "external": ("records", {"poles": 3, "zeros": 2, "delay_samples": 1}),
    "lpv": (
        "responses",
        {
            **{"choose_on": [4], "inputs": ["turn"], "outputs": ["turn"], "order": 3},
            **{"basis": BasisOptions(degree=2), "path": PathOptions(count=2, smallest=10)},
        },
    ),
}


def test_the_same_fit_of_values_in_memory(made, case):
    kind = case.family.name
    assert set(FITS) == {name for name in CASES if name in IN_MEMORY}
    if kind not in IN_MEMORY:
        return
    opened = robid.open(made.runs)
    read, options = IN_MEMORY[kind]
    data, new = (getattr(opened, read)[name] for name in ("estimation", "validation"))
    robot = (robid.load_robot(made.folder / "arm.yaml"),) if kind in ("elastic", "rigid", "transmission") else ()
    found = robid.fit_model(kind, *robot, data, validate_on=new, **options)
    stored = opened.fits["own"]
    assert stored.kind == found.kind == kind
    assert list(stored.parameters) == list(found.parameters)
    for name, one in stored.parameters.items():
        ours = found.parameters[name]
        assert (ours.kind, ours.unit, ours.identified) == (one.kind, one.unit, one.identified)
        for field in ("value", "lower", "upper", "effective_lower", "effective_upper"):
            assert getattr(ours, field) == pytest.approx(getattr(one, field), rel=1e-6)
    assert found.grade.value == stored.grade.value
    ours, left = found.residual, stored.residual
    np.testing.assert_allclose(left.values, ours.values, rtol=1e-4, atol=1e-4 * np.nanmax(np.abs(ours.measured)))
    np.testing.assert_allclose(left.values, left.measured - left.model)
    assert np.isfinite(left.whitened).any()
    assert len(left.axes) == left.measured.ndim
    assert left.abscissa.size in left.measured.shape
    assert stored.reasons == stored.grade.reasons
    assert all(finding.sentence for finding in stored.findings)
    alone = robid.fit_model(kind, *robot, data, **options)
    assert alone.grade is None
    assert "validate_on" in alone.sentence


def test_what_a_run_shows_fits_its_terminal_with_whole_numbers(made, case):
    whole, piped = ask_in_terminal(400, "run", "small.yaml"), made.robid("run", "small.yaml").out
    assert numbers(whole.out) <= numbers(piped)
    assert not left_out(piped)[0]
    for width in (80, 100, 120):
        shown = ask_in_terminal(width, "run", "small.yaml")
        assert shown.code == whole.code == case.code
        assert max(widest(shown.out), widest(shown.err)) <= width
        assert numbers(shown.out) <= numbers(whole.out)


def test_a_table_of_long_names_says_what_it_leaves_out(made):
    loaded = load_experiment(made.folder / "small.yaml")
    present = [path for node in graph(loaded) for path in node.plan.outputs if (made.runs / path).exists()]
    for table in (shown.renderables[0] for shown in gather(CHAIN, loaded, made.runs, present).fits[0].terminal):
        for place, row in enumerate(table.rows):
            if len(row) > 1:
                table.rows[place] = (Text(f"  manipulator_left_axis_7_{row[0].plain.strip()}"), *row[1:])
        for width in (80, 100, 120):
            check_table(table, width)


def check_table(table, width):
    text, whole = screen(table, width), screen(table, 400)
    assert widest(text) <= width
    assert numbers(text) <= numbers(whole)
    gone, _, needed = left_out(text)
    assert set(gone) <= {column.head for column in table.columns}
    assert bool(gone) is (needed > width)
    for place, column in enumerate(table.columns):
        cells = {row[place].plain for row in table.rows if len(row) > 1}
        assert column.head in gone or not column.numbers or all(f" {cell}" in text for cell in cells)
