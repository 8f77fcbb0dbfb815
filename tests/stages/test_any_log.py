"""Any form of a log gives the response of the record that it holds, or is refused where it is wrong."""

import importlib.util
import itertools
import json
import re

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from any_log import MESSAGES, STAMPS, Plan, lay_out, numbers, play, record_response
from any_log_files import NAMED, write
from any_log_text import Text
from linear_loop import LINES, N_SAMPLE
from log_files import WRITERS
from robid.artifacts.kinds import EXCITATION, FRF, excitation_from_artifact, frf_from_artifact
from robid.artifacts.store import read_artifact
from robid.logs.formats.variables import FORMATS
from wrong_logs import COLUMNS, WRONG, channel_of, chosen

KINDS = [
    kind for kind in WRITERS if all(importlib.util.find_spec(each) for each in FORMATS[kind.partition(" ")[0]].needs)
]
TIMED = ("csv TwinCAT", "tdms", "mdf")
"""Formats in which every channel has times of its own, a millisecond apart."""
STAGES = ("design-excitation", "simulate-or-acquire", "estimate-frf")
EXACT, SHARE = 1e-6, 0.9
FAST, SLOW = 12, 300


@st.composite
def texts(draw):
    delimiter = draw(st.sampled_from([",", ";", "\t", "|", "   "]))
    quoted_cells = delimiter != "   " and draw(st.sampled_from([False, False, True]))
    decimal = draw(st.sampled_from([".", ","])) if delimiter != "," or quoted_cells else "."
    header = draw(st.sampled_from(["names", "quoted", "commented", "none"]))
    preface = draw(st.sampled_from(["", "# made by a drive\n% at 20 °C\n", "Recorded by a drive\n"]))
    if preface.startswith("R") and header in ("commented", "none"):
        preface = ""
    return Text(
        delimiter=delimiter,
        decimal=decimal,
        header=header,
        preface=preface,
        units_below=header in ("names", "quoted") and draw(st.booleans()),
        newline=draw(st.sampled_from(["\n", "\r\n"])),
        encoding=draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"])),
        trailing=delimiter != "   " and header != "none" and draw(st.booleans()),
        stated=draw(st.booleans()),
        quoted_cells=quoted_cells,
        gap=draw(st.sampled_from(["nan", "NaN", "#N/A", "-1.#IND", "NULL"])),
        again=header != "none" and draw(st.booleans()),
        foot=draw(st.sampled_from(["", "EOF", "\n*** end of the log ***\n"])),
    )


@st.composite
def plans(draw, **fixed):
    kind = fixed.get("kind") or draw(st.sampled_from([*KINDS, "csv", "csv"]))
    message = kind in MESSAGES
    text = draw(texts()) if kind == "csv" else Text()
    step_s = fixed.get("step_s") or (1e-3 if message or kind in TIMED else draw(st.sampled_from([1e-3, 4e-3])))
    references = fixed.get("references", step_s == 1e-3 and draw(st.booleans()))
    start = draw(st.sampled_from(["record", "earlier", "before", "anywhere"]))
    if references and start == "anywhere":
        start = "before"  # then the references say where the record begins
    # Two periods of one realization say too little of the noise to compare a band with another one.
    few = start != "anywhere"
    estimators = ["logarithmic", "arithmetic", "h1", "robust_local", *["joint"] * references]
    chosen = {
        "kind": kind,
        "text": text,
        "packed": draw(st.sampled_from(["", "", "gz", "bz2"])) if kind == "csv" else "",
        "says_format": draw(st.booleans()),
        "places": "file" if message or text.header == "none" else draw(st.sampled_from(["file", "variable", "one"])),
        "split": draw(st.booleans()),
        "n_conf": draw(st.sampled_from([1, 1, 2])),
        "n_real": draw(st.sampled_from([1, 2])) if few and not references else 2,
        "periods": draw(st.sampled_from([2, 3])) if few else 3,
        "step_s": step_s,
        "motion": draw(st.sampled_from(["angle", "angle", "speed", "acceleration"])),
        "precision": draw(st.sampled_from(["full", "full", "single", "rounded"])),
        "references": references,
        "excitation": "list" if references else draw(st.sampled_from(["band", "list", "found"])),
        "start": start,
        "rest": start in ("earlier", "before") and draw(st.booleans()),
        "time": draw(st.sampled_from(["", "s", "ms", "us"])),
        "estimator": draw(st.sampled_from(estimators)),
        "seed": draw(st.integers(0, 2**16)),
    }
    text_time = kind == "csv" and bool(chosen["time"]) and fixed.get("time") is None
    chosen["stamp"] = draw(st.sampled_from(["", *STAMPS])) if text_time else ""
    if "," in STAMPS.get(chosen["stamp"], "") or " " in STAMPS.get(chosen["stamp"], ""):
        chosen["stamp"] *= text.delimiter != "   "
    chosen["named"] = draw(st.sampled_from(["", *NAMED])) if kind == "csv" and text.delimiter != "   " else ""
    one_length = kind in ("mat", "mat 7.3", "hdf5") and chosen["places"] == "file"
    chosen["matrix"] = draw(st.sampled_from(["", "columns", "rows"])) if one_length else ""
    chosen["wraps"] = chosen["motion"] == "angle" and draw(st.booleans())
    chosen["gaps"] = (
        bool(chosen["time"])
        and kind not in TIMED
        and not message
        and chosen["start"] != "anywhere"
        and draw(st.booleans())
    )
    chosen["disorder"] = bool(chosen["time"]) and kind not in TIMED and not message and draw(st.booleans())
    return Plan(**{**chosen, **fixed})


@pytest.fixture(scope="module")
def bench(workshop, tmp_path_factory):
    """A campaign that was played once, and folders for logs of it."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        shop = workshop(tmp_path_factory.mktemp("any"), monkeypatch)
        plan = Plan(references=True)
        logs = lay_out(plan, play(np.zeros((2, 2, N_SAMPLE, 2))))
        file_experiment(shop, write(logs, shop.folder / "first"))
        assert shop.robid("design-excitation", "log.yaml").code == 0
        designed = excitation_from_artifact(read_artifact(shop.folder / "runs/log/log/excitation.h5", EXCITATION))
        np.testing.assert_array_equal(designed.excitation.excited_lines, LINES)
        shop.played, shop.folders = play(np.asarray(designed.excitation.reference)), itertools.count(1)
        yield shop


def file_experiment(shop, campaign, folder=None):
    settings_ = {"schema_version": 1, "name": "log", "robot": "arm.yaml", "campaigns": {"log": campaign}}
    if folder is not None:
        settings_["robot"] = "../arm.yaml"
    settings_["execution"] = {"backend": "serial"}
    ((folder or shop.folder) / "log.yaml").write_text(json.dumps(settings_, indent=1))


def run(shop, logs):
    """Writes logs and runs the stages; returns the one that ended, its answer, and the folder."""
    folder = shop.folder / str(next(shop.folders))
    folder.mkdir()
    file_experiment(shop, write(logs, folder / "logs"), folder)
    for stage in STAGES:
        answer = shop.robid(stage, str(folder / "log.yaml"), "--force")
        if answer.code:
            break
    return stage, answer, folder


def check_response(shop, plan):
    stage, answer, folder = run(shop, lay_out(plan, shop.played))
    assert answer.code == 0, f"{stage}: {answer.err}"
    path = next(folder.rglob("frf.h5"), None) or next(shop.folder.glob("runs/log/log/frf.h5"))
    found = frf_from_artifact(read_artifact(path, FRF))
    np.testing.assert_array_equal(found.lines, LINES)
    for index, wanted in enumerate(record_response(plan, shop.played)):
        error = np.abs(found.response[index] - wanted.response[0])
        radius = wanted.error_radius(0.95)[0]
        if plan.is_exact:
            # After a turn is added small motions have fewer digits.
            allowed = (100 if plan.wraps else 1) * EXACT
            assert error.max() < allowed * np.abs(wanted.response).max(), plan
            variances = found.element_variance()[index], wanted.element_variance()[0]
            np.testing.assert_allclose(*variances, rtol=2e-2 if plan.wraps else 1e-3, err_msg=str(plan))
        else:
            # Begun elsewhere, both have noise of their own in at least some of their samples.
            both = np.hypot(radius, found.error_radius(0.95)[index])
            assert np.mean(error <= both) >= SHARE, plan


DRAWN = {"suppress_health_check": list(HealthCheck), "phases": (Phase.generate,)}


@given(plan=plans())
@settings(max_examples=FAST, **DRAWN)
def test_any_form_of_a_log_gives_the_response_of_its_record(bench, plan):
    check_response(bench, plan)


@pytest.mark.slow
@given(plan=plans())
@settings(max_examples=SLOW, **DRAWN)
def test_very_many_forms_of_a_log_give_the_response_of_their_record(bench, plan):
    check_response(bench, plan)


@given(data=st.data())
@pytest.mark.parametrize("case", sorted(WRONG))
@settings(max_examples=2, **DRAWN)
def test_a_log_that_is_wrong_is_refused(bench, case, data):
    check_refusal(bench, case, data)


@pytest.mark.slow
@given(data=st.data())
@pytest.mark.parametrize("case", sorted(WRONG))
@settings(max_examples=15, **DRAWN)
def test_a_log_that_is_wrong_in_whatever_form_is_refused(bench, case, data):
    check_refusal(bench, case, data)


def check_refusal(shop, case, data):
    spoil, fixed = WRONG[case]
    usable = [kind for kind in KINDS if "time" not in fixed or kind not in MESSAGES]
    kind = fixed.get("kind") or data.draw(st.sampled_from(usable))
    plan = data.draw(plans(**{"disorder": False, **fixed, "kind": kind, "matrix": ""}))
    logs = lay_out(plan, shop.played)
    told = spoil(logs)
    stage, answer, folder = run(shop, logs)
    said = f"{case}, {stage}, {plan}: {answer.err}"
    assert answer.code in (2, 4), said
    assert len(re.findall(r"^robid: ", answer.err, re.MULTILINE)) == 1, said
    assert "Traceback" not in answer.err, said
    acquire = json.loads((folder / "log.yaml").read_text())["campaigns"]["log"]["source"]["acquire"]
    index, _ = chosen(logs)
    for text in ("remedy: ", *told):
        wanted = f"`{channel_of(acquire, text)['variable'].format(**numbers(index))}`" if text in COLUMNS else text
        assert wanted in answer.flat, f"`{wanted}` lacks: {said}"
