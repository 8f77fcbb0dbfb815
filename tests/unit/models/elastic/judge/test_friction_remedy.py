"""Which setting finds the friction of a robot, by what a response shows and what was subtracted from it."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot
from robid.frf.frf import NO_RECORD
from robid.models.elastic.judge.friction import friction_remedy, with_friction_remedies
from robid.results.finding import Finding

ODD = np.arange(1, 30, 2)


def response(excited, silent, compensation="nominal"):
    """A response at some lines of a period of 2 s, with others silent."""
    frf = exact_frf(two_joint_robot(), np.zeros((1, 2)), excited / 2.0)
    return replace(frf, lines=excited, silent_lines=np.asarray(silent, int), compensation=compensation)


def test_enough_silent_lines_are_to_be_used_and_too_few_ask_for_a_longer_period():
    # Of odd lines alone friction reaches the odd ones: even ones do not count.
    even = np.arange(2, 60, 2)
    enough = friction_remedy(response(ODD, [*even, *np.arange(31, 59, 2)]))
    assert "`compensation: silent_lines`" in enough
    assert "period_s" not in enough
    few = friction_remedy(response(ODD, even))
    assert "`period_s: 4`" in few  # twice as many lines: 15 excited and 15 silent
    assert "`compensation: silent_lines`" in few


@pytest.mark.parametrize("compensation", ["silent_lines", "nominal"])
def test_where_no_line_says_more_another_fit_does(compensation):
    silent = np.arange(2, 60, 2) if compensation == "silent_lines" else []
    assert "{fit: NAME}" in friction_remedy(response(ODD, silent, compensation))


def test_a_response_without_its_record_has_no_settings_for_friction():
    told = friction_remedy(replace(response(ODD, []), notes=(NO_RECORD,)))
    assert "silent_lines" not in told
    assert "{fit: NAME}" not in told
    assert "record" in told


def test_silent_lines_are_no_remedy_where_friction_that_grows_with_the_load_is_estimated():
    frf = response(ODD, [*np.arange(2, 60, 2), *np.arange(31, 59, 2)])
    given = [Finding("friction", "the level is off", decisive=False, strength=2.0)]
    by_law, by_load = (with_friction_remedies(given, frf, by_load=estimated)[0].message for estimated in (False, True))
    assert "silent_lines" in by_law
    assert "silent_lines" not in by_load


def test_only_friction_without_a_remedy_gets_one():
    frf = response(ODD, np.arange(2, 60, 2))
    given = [
        Finding("friction", "the level is off", decisive=False, strength=2.0),
        Finding("friction", "viscous friction (try `free: [viscous]`)", decisive=False, strength=2.0),
        Finding("masses", "a mass is off", decisive=False, strength=2.0),
    ]
    found = with_friction_remedies(given, frf)
    assert found[0].message != given[0].message
    assert found[1:] == given[1:]
