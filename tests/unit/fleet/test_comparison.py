"""Fleets with known faults: who is off, who changes, what is compared, and what the files say of it."""

import json
from dataclasses import replace

import numpy as np
import pytest

from fabricated_fleets import KNOWN, SPREAD, entry, failed, found_in, ledger, sound, with_factor
from robid.fleet.comparison import collect
from robid.fleet.sections import drift_sections, outlier_sections
from robid.fleet.summary import check_summary, write_summary
from robid.robot.parameters import LOGARITHMIC

SPRING, DAMPER = "gear_a1.stiffness", "gear_a1.damping"


def off(found):
    """What is off, by row: the clearest first."""
    comparison = found.comparison
    return {
        found.ledgers[row].id: [comparison.names(each.trait)[1] for each in outliers]
        for row, outliers in comparison.off.items()
    }


@pytest.fixture
def fleet():
    return list(sound(40))


def planted(fleet):
    fleet[7] = with_factor(fleet[7], SPRING, 0.7)
    fleet[20] = replace(fleet[20], misfits={"elastic": {"misfit": 3.0}})
    fleet[21] = replace(fleet[21], misfits={"elastic": {"misfit": 0.1}})
    fleet[30] = failed("r30", "a channel is dead")
    return fleet


def test_the_softened_spring_and_the_large_misfit_are_off_and_nobody_else(fleet):
    assert off(found_in(fleet)) == {}
    found = found_in(planted(fleet))
    assert off(found) == {"r20": ["misfit"], "r7": [SPRING]}
    away = found.comparison.away["elastic", SPRING]
    assert np.isnan(away[30])
    assert away[7] == pytest.approx(np.log(0.7) / np.hypot(SPREAD, KNOWN), rel=0.3)
    assert np.nanmax(np.abs(np.delete(away, 7))) < 4


def test_the_effective_value_is_compared_and_the_estimate_where_there_is_none(fleet):
    """The spring itself is far off in one row, what predicts is not; another row has nothing but an estimate."""
    own = fleet[3].results[0]
    fleet[3] = replace(fleet[3], results=({**own, "physical": 0.1e6, "estimate": 0.1e6}, *fleet[3].results[1:]))
    bare = {key: value for key, value in fleet[4].results[0].items() if not key.startswith("effective")}
    fleet[4] = replace(
        fleet[4], results=({**bare, "estimate": 0.5e6, "standard_deviation": 1e4}, *fleet[4].results[1:])
    )
    assert off(found_in(fleet)) == {"r4": [SPRING]}


@pytest.mark.parametrize("changed", [{"identified": False}, {"tied_to": "gear_a2.stiffness"}])
def test_what_is_not_identified_or_follows_another_is_not_compared(fleet, changed):
    fleet[3] = ledger("r3", [entry(SPRING, 1e5, **changed)])
    assert off(found_in(fleet)) == {}


@pytest.mark.parametrize("kind", ["doubt", "friction"])
def test_nuisances_are_left_out(kind):
    assert collect([ledger("a", [entry(SPRING, 1e6, kind=kind)])]) == {}


def test_springs_are_compared_by_logarithms_and_delays_as_they_are():
    assert "delay" not in LOGARITHMIC
    found = collect([ledger("a", [entry(SPRING, 2e6), entry("delay", -1e-3)])])
    (_, spring, spring_std), (_, delay, delay_std) = found["elastic", SPRING].known, found["elastic", "delay"].known
    assert (spring, spring_std) == (pytest.approx(np.log(2e6)), pytest.approx(KNOWN, rel=1e-3))
    assert (delay, np.abs(delay_std)) == (pytest.approx(-1e-3), pytest.approx(KNOWN * 1e-3, rel=1e-3))


def test_a_value_that_is_hardly_known_is_not_off(fleet):
    wide = {"effective": 0.5e6, "effective_low": 0.2e6, "effective_high": 1.3e6}
    fleet[5] = replace(fleet[5], results=(entry(SPRING, 0.5e6, **wide), *fleet[5].results[1:]))
    assert off(found_in(fleet)) == {}


def test_groups_are_populations_of_their_own(fleet):
    """Half of the robots are of a softer type; one of the others is as soft as these."""
    types = ["soft" if number % 2 else "hard" for number in range(40)]
    mixed = [
        with_factor(each, SPRING, 0.5) if kind == "soft" else each for each, kind in zip(fleet, types, strict=True)
    ]
    mixed[6] = with_factor(mixed[6], SPRING, 0.5)
    assert off(found_in(mixed, group=types)) == {"r6": [SPRING]}
    [section] = outlier_sections(found_in(mixed))
    assert "Are these two types? A column `group` tells" in section.lead


def test_with_few_robots_it_is_said_that_outliers_cannot_be_told(fleet, tmp_path):
    fleet[0] = with_factor(fleet[0], SPRING, 0.1)
    found = found_in(fleet[:7])
    assert off(found) == {}
    write_summary(tmp_path / "fleet.json", "arms", found.ledgers, found.comparison)
    assert json.loads((tmp_path / "fleet.json").read_text())["untold"] == ["all"]
    [section] = outlier_sections(found)
    assert "With fewer than 8 robots, outliers cannot be named." in section.lead
    groups = ["A"] * 35 + ["B"] * 5
    [section] = outlier_sections(found_in(fleet, group=groups))
    assert "With fewer than 8 robots in 1 group (B), outliers cannot be named." in section.lead
    repeated = found_in(fleet[:20], robot=[f"arm{number % 5}" for number in range(20)])
    assert repeated.comparison.untold == (0,)


def drifting():
    """Ten robots measured four times; a damper of the third loses a tenth a month."""
    every = []
    for month in range(4):
        for number, each in enumerate(sound(10)):
            factor = 0.9**month if number == 2 else 1.0
            noise = 1 + 0.003 * np.sin(7.0 * number + 3 * month)
            every.append(with_factor(each, DAMPER, factor * noise))
    return [replace(each, id=f"log{place}") for place, each in enumerate(every)]


@pytest.mark.parametrize("timed", [True, False])
def test_the_robot_that_changes_is_named_with_slope_and_interval(timed, tmp_path):
    rows = drifting()
    times = {"time": [f"2026-0{1 + place // 10}-01T12:00:00Z" for place in range(40)]} if timed else {}
    found = found_in(rows, robot=[f"arm{place % 10}" for place in range(40)], **times)
    [drift] = found.comparison.drifts
    write_summary(tmp_path / "fleet.json", "arms", found.ledgers, found.comparison)
    [told] = json.loads((tmp_path / "fleet.json").read_text())["drifts"]
    assert (told["robot"], told["name"], told["measurements"], told["relative"]) == ("arm2", DAMPER, 4, True)
    assert told["change"] == pytest.approx(0.9**3 - 1, abs=0.02)
    assert told["change_low"] < 0.9**3 - 1 < told["change_high"] < 0
    months = (31 + 28 + 31) / 3 if timed else 1
    assert drift.slope * months == pytest.approx(np.log(0.9), abs=0.02)


@pytest.mark.parametrize(
    ("rows", "times", "followed", "text"),
    [
        (8, [0, 0, 0, 0, 1, 1, 1, 1], 4, "Of 4 robots that were measured more than once, none changes clearly"),
        (8, [0] * 8, 0, "Of 4 robots that were measured more than once, none has values of different times"),
        (4, [0, 0, 0, 0, 1, 1, 1, 1], 0, "Of 4 robots that were measured more than once, none has values of"),
        (6, [0, 0, 0, 0, 1, 1, 1, 1], 2, "clearly: a chance of 1 % for a fleet that does not change to have any"
         " robot named here. 2 robots cannot be judged, without values of different times."),
    ],
)  # fmt: skip
def test_robots_that_could_not_be_followed_are_told(rows, times, followed, text, tmp_path):
    """Of eight rows of four robots the last have failed."""
    fleet = [each if place < rows else failed(each.id, "a channel is dead") for place, each in enumerate(sound(8))]
    found = found_in(fleet, robot=[f"arm{place % 4}" for place in range(8)], time=times)
    [section] = drift_sections(found)
    assert text in section.lead
    write_summary(tmp_path / "fleet.json", "arms", found.ledgers, found.comparison)
    told = json.loads((tmp_path / "fleet.json").read_text())
    assert (told["repeated"], told["followed"], told["drifts"]) == (4, followed, [])


def test_the_file_names_everything_and_is_written_once(fleet, tmp_path):
    found, path = found_in(planted(fleet)), tmp_path / "fleet.json"
    assert write_summary(path, "arms", found.ledgers, found.comparison) == "made"
    assert write_summary(path, "arms", found.ledgers, found.comparison) == "fresh"
    check_summary(path)
    told = json.loads(path.read_text())
    assert (told["kind"], told["schema_version"], told["rows"], told["robots"]) == ("fleet", "1.1", 40, 40)
    assert told["failures"] == [
        {"kind": "data", "message": "a channel is dead", "remedy": "log again", "count": 1, "rows": ["r30"]}
    ]
    misfit, spring = told["outliers"]
    assert (misfit["row"], misfit["name"], misfit["value"]) == ("r20", "misfit", pytest.approx(3.0))
    assert (spring["row"], spring["unit"], spring["away"] < -8) == ("r7", "N m/rad", True)
    assert spring["low"] < spring["value"] < spring["high"] < spring["centre"]
    assert spring["chance"] < 0.01
    of_spring = next(each for each in told["populations"] if each["name"] == SPRING)
    assert of_spring["centre"] == pytest.approx(1e6, rel=0.02)
    assert of_spring["spread"] == pytest.approx(SPREAD, rel=0.4)
    assert (of_spring["robots"], of_spring["relative"]) == (39, True)
