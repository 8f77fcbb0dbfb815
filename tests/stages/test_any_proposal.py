"""What is proposed of any log of a drive gives the response that it was made of, at once or by its own remedies."""

import re

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML

from any_drive import ANGLE, LINES, NAMED, NAMES, PERIOD, STEP_S, TORQUE, Drive, response
from any_log import STAMPS
from any_log_text import Text
from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.store import read_artifact

STAGES = ("design-excitation", "simulate-or-acquire", "estimate-frf")
SETTING = re.compile(r"(?:[Ss]et|,|and) (?!or)([a-z_][\w.]*) to ([\w.+-]*\w)")
ROUNDS = 3
TIMED = ("csv TwinCAT", "csv LabVIEW", "tdms", "Simulink", "ControlDesk")
"""Layouts that have a time of their own."""

FAST, SLOW = 12, 150
DRAWN = {"suppress_health_check": list(HealthCheck), "phases": (Phase.generate,)}


@st.composite
def texts(draw):
    delimiter = draw(st.sampled_from([",", ";", "\t"]))
    quoted = draw(st.booleans())
    return Text(
        delimiter=delimiter,
        decimal=draw(st.sampled_from([".", ","])) if quoted or delimiter != "," else ".",
        header=draw(st.sampled_from(["names", "quoted", "commented"])),
        preface=draw(st.sampled_from(["", "# made by a drive\n"])),
        newline=draw(st.sampled_from(["\n", "\r\n"])),
        encoding=draw(st.sampled_from(["utf-8", "utf-16", "cp1252"])),
        quoted_cells=quoted,
        again=draw(st.booleans()),
        foot=draw(st.sampled_from(["", "EOF"])),
    )


@st.composite
def drives(draw):
    layout = draw(st.sampled_from(["text", "text", "text", "mat", "mat 7.3", "hdf5", "parquet", *TIMED]))
    is_text = layout == "text"
    time = draw(st.sampled_from(["s", "ms", "us"])) if layout not in TIMED else ""
    wraps = draw(st.booleans())
    return Drive(
        layout=layout,
        text=draw(texts()) if is_text else Text(),
        words=draw(st.sampled_from(sorted(NAMES))),
        named="underscore" if layout.startswith("mat") else draw(st.sampled_from(sorted(NAMED))),
        torque=draw(st.sampled_from(sorted(TORQUE))),
        angle=draw(st.sampled_from(sorted(ANGLE))),
        time=time,
        stamp=draw(st.sampled_from(["", "", *STAMPS])) if is_text else "",
        offset=draw(st.sampled_from([0.0, 1.0, 3.0])) if wraps else draw(st.sampled_from([0.0, 0.37, -2.1])),
        turned=draw(st.booleans()),
        wraps=wraps,
        shift=draw(st.integers(0, PERIOD - 1)),
        periods=draw(st.integers(4, 6)),
        order=tuple(draw(st.permutations(range(4)))),
    )


def follow(settings_, message):
    """Applies what a remedy says to set; fails where it says nothing of the kind."""
    changed = SETTING.findall(message.partition("remedy: ")[2])
    assert changed, f"nothing can be followed in: {message}"
    campaign = settings_["campaigns"]["log"]
    acquire = campaign["source"]["acquire"]
    for name, value in changed:
        section, _, key = name.rpartition(".")
        place = {"excitation": campaign["excitation"], "time": acquire.get("time")}.get(section)
        place = place if section else campaign if key == "periods" else acquire
        place[key] = YAML(typ="safe").load(value)


def check_proposal(shop, drive):
    path = drive.write(shop.folder)
    answer = shop.robid("inspect", str(path), "--propose", "p.yaml")
    assert answer.code == 0, answer.err
    for _ in range(ROUNDS):
        for stage in STAGES:
            answer = shop.robid(stage, "p.yaml", "--force")
            if answer.code:
                break
        if not answer.code:
            break
        assert answer.code in (2, 4), answer.err
        told = YAML(typ="safe").load((shop.folder / "p.yaml").read_text())
        follow(told, answer.err)
        YAML(typ="safe").dump(told, shop.folder / "p.yaml")
    assert answer.code == 0, answer.err
    found = frf_from_artifact(read_artifact(next(shop.folder.glob("runs/*/log/frf.h5")), FRF))
    at = np.searchsorted(LINES, np.round(found.frequency_hz * PERIOD * STEP_S).astype(int))
    np.testing.assert_array_equal(LINES[at], found.frequency_hz * PERIOD * STEP_S)
    assert len(at) == len(LINES)
    wanted = response()
    error = np.abs(found.response[0, :, :, 0] - wanted).max(axis=0)
    assert np.all(error < 1e-3 * np.abs(wanted).max(axis=0)), (drive, (shop.folder / "p.yaml").read_text())


@given(drive=drives())
@settings(max_examples=FAST, **DRAWN)
def test_what_is_proposed_of_any_log_gives_its_response(workshop, tmp_path_factory, drive):
    with pytest.MonkeyPatch.context() as monkeypatch:
        check_proposal(workshop(tmp_path_factory.mktemp("any"), monkeypatch), drive)


@pytest.mark.slow
@given(drive=drives())
@settings(max_examples=SLOW, **DRAWN)
def test_what_is_proposed_of_very_many_logs_gives_their_response(workshop, tmp_path_factory, drive):
    with pytest.MonkeyPatch.context() as monkeypatch:
        check_proposal(workshop(tmp_path_factory.mktemp("any"), monkeypatch), drive)
