"""Any form of a log gives the response of the record that it holds, or is refused where it is wrong."""

import importlib.util
import itertools
import json
import re

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from any_log import FIRST, MESSAGES, Plan, Text, lay_out, play, record_response, write
from linear_loop import LINES, N_SAMPLE
from log_files import WRITERS
from robid.artifacts.excitation import EXCITATION, excitation_from_artifact
from robid.artifacts.frf import FRF, frf_from_artifact
from robid.artifacts.store import read_artifact
from robid.logs.formats.known import FORMATS

NAMES = {"mat 7.3": "mat"}
KINDS = [
    kind for kind in WRITERS if all(importlib.util.find_spec(each) for each in FORMATS[NAMES.get(kind, kind)].needs)
]
STAGES = ("design-excitation", "simulate-or-acquire", "estimate-frf")
EXACT, SHARE = 1e-6, 0.9
SLOW = 300


@st.composite
def texts(draw):
    delimiter = draw(st.sampled_from([",", ";", "\t", "|", "   "]))
    decimal = draw(st.sampled_from([".", ","])) if delimiter != "," else "."
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
    )


@st.composite
def plans(draw, **fixed):
    kind = fixed.get("kind") or draw(st.sampled_from([*KINDS, "csv", "csv"]))
    message = kind in MESSAGES
    text = draw(texts()) if kind == "csv" else Text()
    step_s = 1e-3 if message else draw(st.sampled_from([1e-3, 4e-3]))
    references = step_s == 1e-3 and draw(st.booleans())
    start = draw(st.sampled_from(["record", "earlier", "before", "anywhere"]))
    if references and start == "anywhere":
        start = "before"  # then the references say where the record begins
    estimators = ["logarithmic", "arithmetic", "h1", "robust_local", *["joint"] * references]
    chosen = {
        "kind": kind,
        "text": text,
        "packed": draw(st.sampled_from(["", "", "gz", "bz2"])) if kind == "csv" else "",
        "says_format": draw(st.booleans()),
        "places": "file" if message or text.header == "none" else draw(st.sampled_from(["file", "variable", "one"])),
        "split": draw(st.booleans()),
        "n_conf": draw(st.sampled_from([1, 1, 2])),
        "n_real": 2 if references else draw(st.sampled_from([1, 2])),
        "periods": draw(st.sampled_from([2, 3])),
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
    chosen["gaps"] = bool(chosen["time"]) and not message and chosen["start"] != "anywhere" and draw(st.booleans())
    return Plan(**{**chosen, **fixed})


def excitation(plan):
    period_s = N_SAMPLE * plan.step_s
    low, high = ((line + side) / period_s for line, side in ((LINES[0], -0.25), (LINES[-1], 0.25)))
    stated = {
        "band": {"count": len(LINES), "spacing": "linear", "detection_share": 0},
        "list": {"lines": LINES.tolist()},
        "found": {"lines": "found", "grid": "full"},
    }[plan.excitation]
    return {"period_s": period_s, "low_hz": low, "high_hz": high, "rms": 2, "seed": 3, **stated}


@pytest.fixture(scope="module")
def bench(workshop, tmp_path_factory):
    """A campaign that was played once, and folders for logs of it."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        shop = workshop(tmp_path_factory.mktemp("any"), monkeypatch)
        plan = Plan(references=True)
        logs = lay_out(plan, play(np.zeros((2, 2, N_SAMPLE, 2))))
        file_experiment(shop, write(logs, shop.folder / "first", excitation(plan)))
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
    """Writes logs and runs them; returns the stage that ended, its answer, and the folder."""
    folder = shop.folder / str(next(shop.folders))
    folder.mkdir()
    campaign = write(logs, folder / "logs", excitation(logs.plan))
    return run_campaign(shop, campaign, folder)


def run_campaign(shop, campaign, folder):
    file_experiment(shop, campaign, folder)
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
            assert error.max() < EXACT * np.abs(wanted.response).max(), plan
            variances = found.element_variance()[index], wanted.element_variance()[0]
            np.testing.assert_allclose(*variances, rtol=1e-3, err_msg=str(plan))
        else:
            # Begun elsewhere, both have noise of their own in at least some of their samples.
            both = np.hypot(radius, found.error_radius(0.95)[index])
            assert np.mean(error <= both) >= SHARE, plan


DRAWN = {"suppress_health_check": list(HealthCheck), "phases": (Phase.generate, Phase.shrink)}


@given(plan=plans())
@settings(max_examples=60, **DRAWN)
def test_any_form_of_a_log_gives_the_response_of_its_record(bench, plan):
    check_response(bench, plan)


@pytest.mark.slow
@given(plan=plans())
@settings(max_examples=SLOW, **DRAWN)
def test_very_many_forms_of_a_log_give_the_response_of_their_record(bench, plan):
    check_response(bench, plan)


WRONG = {}
COLUMNS = ("u1", "u2", "q1", "q2", "ref1", "ref2")


def wrong(**fixed):
    """Registers what spoils logs, and what is fixed of their plan so that it can be seen."""

    def register(spoil):
        WRONG[spoil.__name__] = (spoil, fixed)
        return spoil

    return register


# Each spoils one log and returns which, and what the message has to say; a change of the campaign is returned, too.


def chosen(logs):
    index = list(logs.columns)[logs.plan.seed % len(logs.columns)]
    names = [name for name in logs.columns[index] if name[:-1] in ("u", "q", "ref")]
    return index, names[logs.plan.seed // 16 % len(names)]


def inside(logs, index):
    """A sample of the part that is used, not near the ends of a period."""
    at = logs.plan.seed % (N_SAMPLE - 40) + 20
    return logs.begin[index] + N_SAMPLE + at


def part_of(logs, name):
    return "out_" if logs.plan.split and name.startswith("q") else ""


def variable_of(campaign, name):
    acquire = campaign["source"]["acquire"]
    group = {"u": "inputs", "q": "outputs", "r": "references"}[name[0]]
    return acquire[group][int(name[-1]) - 1]


@wrong(precision="full", motion="acceleration")
def lost_value(logs):
    """One value is NaN."""
    index, name = chosen(logs)
    at = inside(logs, index)
    logs.columns[index][name][at] = np.nan
    return [logs.file_name(index, part_of(logs, name)), f"sample {at}", "NaN", name]


@wrong()
def dead_channel(logs):
    """A channel was not connected."""
    index, name = chosen(logs)
    logs.columns[index][name][:] = 3
    return [logs.file_name(index, part_of(logs, name)), "It is constant (3)", name]


@wrong()
def missing_variable(logs):
    """A variable has another name in the log."""
    index, name = chosen(logs)
    group = {"u": "inputs", "q": "outputs", "r": "references"}[name[0]]
    logs.channels[group][int(name[-1]) - 1]["variable"] = f"{name}_filtered"
    return [f"{name}_filtered", "no such variable"]


@wrong(places="file")
def missing_file(logs):
    """A log was not recorded."""
    index, name = chosen(logs)
    logs.missing = logs.file_name(index, part_of(logs, name))
    return [logs.missing]


@wrong(places="file", estimator="logarithmic", periods=3, precision="full")
def lost_sample(logs):
    """A sample of all channels is lost, and the log has no time that tells."""
    index, _ = chosen(logs)
    at = inside(logs, index)
    columns = logs.columns[index]
    for name in columns:
        columns[name] = np.delete(np.asarray(columns[name]), at)
    if "t" in columns:
        return [logs.file_name(index), "1 gap", f"after sample {at - 1}"]
    return []


@wrong(places="file", kind="hdf5")
def shorter_channel(logs):
    """One channel ends a sample before the others."""
    index, name = chosen(logs)
    logs.columns[index][name] = logs.columns[index][name][:-1]
    return [logs.file_name(index, part_of(logs, name)), name, "samples, the other channels have"]


@wrong(places="file", take_all=True)
def too_short(logs):
    """A log ends before its last period does."""
    index, _ = chosen(logs)
    stop = logs.begin[index] + (logs.plan.periods - 1) * N_SAMPLE + 60
    logs.columns[index] = {name: values[:stop] for name, values in logs.columns[index].items()}
    return [logs.file_name(index)]


@wrong(references=True, step_s=1e-3, n_real=2, excitation="list")
def unit_of_a_reference(logs):
    """A reference is in another unit than is said."""
    units = {"rad/s": "rpm", "rpm": "deg/s", "deg/s": "rad/s"}
    reference = logs.channels["references"][logs.plan.seed % 2]
    reference["unit"] = units[reference["unit"]]
    return ["differ in size from the excitation", reference["name"], "unit or scale"]


@wrong()
def unknown_unit(logs):
    """An output's unit is written in another way."""
    channel = logs.channels["outputs"][logs.plan.seed % 2]
    channel["unit"] = "degrees"
    return ["log.yaml", "outputs", "unit", "'deg'"]


@wrong()
def period_off_by_a_sample(logs):
    """The period is stated one sample too long or too short."""
    sign = 1 if logs.plan.seed % 2 else -1
    logs.period_samples = N_SAMPLE + sign
    return [] if logs.plan.references else ["256 samples"]


@wrong(references=False, excitation="list", start="record")
def lines_that_were_not_excited(logs):
    """The lines are said to be two higher."""
    logs.lines = (LINES + 2).tolist()
    return [logs.file_name((0, 0, 0)), "9-49 by 4"]


@wrong(time="ms", gaps=False)
def unit_of_the_time(logs):
    """The time is said to be in seconds, but is in ms."""
    for columns in logs.columns.values():
        if "t" in columns:
            columns["t"] = columns["t"] * 1000
    return ["time unit is off by a factor of 1000", "time.unit to us"]


@wrong(time="s")
def time_that_stands_still(logs):
    """The time repeats a stamp."""
    index, _ = chosen(logs)
    at = inside(logs, index)
    logs.columns[index]["t"][at] = logs.columns[index]["t"][at - 1]
    return [logs.file_name(index), "Time does not advance", f"after sample {at - 1}"]


@wrong(references=True, step_s=1e-3, n_real=2, excitation="list", places="file", split=False)
def exchanged_logs(logs):
    """Two logs have each other's names."""
    first, second = (0, 0, 0), (0, 1, 1)
    columns = logs.columns
    columns[first], columns[second] = columns[second], columns[first]
    return [logs.file_name(first), "It holds realization 2, experiment 2"]


@wrong(places="file", estimator="logarithmic")
def the_same_log_twice(logs):
    """Both experiments of a block are one."""
    index, _ = chosen(logs)
    first, second = (*index[:2], 0), (*index[:2], 1)
    logs.columns[second], logs.begin[second] = logs.columns[first], logs.begin[first]
    return []


@wrong(places="file")
def cut_file(logs):
    """A file was copied by half."""
    index, name = chosen(logs)
    logs.cut = logs.file_name(index, part_of(logs, name))
    return [logs.cut]


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
    fixed = {key: value for key, value in fixed.items() if key != "take_all"}
    kinds = [kind for kind in KINDS if kind not in MESSAGES] if "time" in fixed else KINDS
    plan = data.draw(plans(kind=data.draw(st.sampled_from([fixed.pop("kind", None)] if "kind" in fixed else kinds)), **fixed))
    logs = lay_out(plan, shop.played)
    told = spoil(logs)
    folder = shop.folder / str(next(shop.folders))
    folder.mkdir()
    signal = excitation(plan)
    if hasattr(logs, "period_samples"):
        signal["period_s"] = logs.period_samples * plan.step_s
    signal["lines"] = getattr(logs, "lines", signal.get("lines"))
    signal = {key: value for key, value in signal.items() if value is not None}
    campaign = write(logs, folder / "logs", signal)
    if hasattr(logs, "missing"):
        (folder / "logs" / logs.missing).unlink()
    if hasattr(logs, "cut"):
        path = folder / "logs" / logs.cut
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    stage, answer, _ = run_campaign(shop, campaign, folder)
    said = f"{case}, {stage}, {plan}: {answer.err}"
    assert answer.code in (2, 4), said
    assert len(re.findall(r"^robid: ", answer.err, re.MULTILINE)) == 1, said
    assert "Traceback" not in answer.err, said
    index, _ = chosen(logs)
    numbers = dict(zip(("configuration", "realization", "experiment"), (i + 1 for i in index), strict=True))
    for text in ("remedy: ", *told):
        if text in COLUMNS:
            text = f"`{variable_of(campaign, text)['variable'].format(**numbers)}`"
        assert text in answer.flat, f"`{text}` lacks: {said}"
