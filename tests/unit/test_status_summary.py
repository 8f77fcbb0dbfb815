"""What `status` says of a run that is stale: each cause once, and how much follows from it."""

from types import SimpleNamespace

from robid.commands.status import _first_cause, shortened
from robid.scaffold.foreign import _limit

NAMES = ", ".join(f"robot.joints[{number}].motor.gear_ratio" for number in range(1, 8))
ROWS = [
    ("estimation/excitation.h5", "stale", f"settings changed: {NAMES}"),
    ("validation/excitation.h5", "stale", f"settings changed: {NAMES}"),
    ("estimation/record.h5", "stale", f"settings changed: {NAMES}; input estimation/excitation.h5 will be made again"),
    ("estimation/frf.h5", "stale", "input estimation/record.h5 will be made again"),
    ("fits/own/model.h5", "stale", f"settings changed: {NAMES}, fits.own.starts; input estimation/frf.h5 changed"),
    ("designs/best.h5", "missing", "not made yet"),
    ("other/frf.h5", "fresh", ""),
]


def test_a_cause_is_said_once_and_names_few_settings():
    short = {output: why for output, _, why in shortened(ROWS)}
    assert [(output, status) for output, status, _ in shortened(ROWS)] == [row[:2] for row in ROWS]
    assert short["estimation/excitation.h5"].count("gear_ratio") == 3
    assert "4 more" in short["estimation/excitation.h5"]
    assert "gear_ratio" not in "".join(short[name] for name in ("validation/excitation.h5", "estimation/record.h5"))
    assert "estimation/excitation.h5" in short["estimation/record.h5"]
    assert "estimation/record.h5" in short["estimation/frf.h5"]
    # What is new of an output is said of it.
    assert "input estimation/frf.h5 changed" in short["fits/own/model.h5"]
    assert short["designs/best.h5"] == "not made yet"
    assert short["other/frf.h5"] == ""


def test_the_first_cause_is_said_with_how_much_is_stale():
    (line,) = _first_cause(ROWS)
    assert line.startswith("5 of 7 stale")
    assert "joints[1]" in line
    assert _first_cause(ROWS[-2:]) == []


def test_a_limit_that_was_replaced_says_by_how_much():
    joint, drive = SimpleNamespace(name="elbow", slides=False), SimpleNamespace(max_torque_nm=0.5, ratio=100.0)
    said = {}
    for stated in (10.0, 500.0, 0.0):
        drive.torque_left_out = stated
        said[stated] = _limit(joint, drive)
    assert "raised 5 times" in said[10.0]
    assert "from 10 to 50 N m" in said[10.0]
    assert "lowered 10 times" in said[500.0]
    assert "raised from 0 to 50" in said[0.0]
