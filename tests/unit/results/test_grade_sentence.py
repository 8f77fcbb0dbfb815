"""A sentence of trust names what it leaves out."""

import numpy as np
import pytest

from robid.models.conclusions import Row, estimate_of_rows, outcome_of
from robid.models.parameters import parameter_rows
from robid.report.parameter_section import identified_phrase, parameter_numbers
from robid.report.parameters import Estimates
from robid.results.finding import Finding
from robid.results.grade import PREDICTS, TRUST

STD = {"a.inertia": 0.01, "b.inertia": 0.5, "c.inertia": 0.3, "d.inertia": 0.02}


def estimated(std=STD, kind="inertia"):
    rows = [Row(name, kind, "kg m^2", 1.0, 1.0, np.zeros(0)) for name in std]
    covariance = np.diag(np.square(list(std.values())))
    options = {"confidence": 0.95, "identifiable_relative_std": 0.2}
    return estimate_of_rows(rows, covariance, "noise", "converged", "", **options)


def sentence(estimate, findings=()):
    return outcome_of(estimate, findings, (), "holds").grade


def test_trust_names_what_the_data_do_not_determine():
    grade = sentence(estimated())
    assert grade.value == TRUST
    assert all((name in grade.sentence) == (std > 0.2) for name, std in STD.items())
    assert grade.reasons == ()


def test_trust_in_all_leaves_nothing_out():
    assert not any(name in sentence(estimated({"a.inertia": 0.01})).sentence for name in STD)


def test_a_long_list_is_cut_and_counted():
    many = {f"link_{index}.inertia": 1.0 for index in range(11)}
    told = sentence(estimated(many)).sentence
    named = sum(f"{name}" in told.replace(",", " ").split() for name in many)
    assert 0 < named < 11
    assert str(11 - named) in told


@pytest.mark.parametrize("kind", ["friction", "integrator"])
def test_what_is_only_in_the_way_is_not_named(kind):
    assert "b.inertia" not in sentence(estimated(kind=kind)).sentence


def test_other_grades_say_why_instead():
    grade = sentence(estimated(), [Finding("model", "it is off", decisive=False, strength=2.0)])
    assert grade.value == PREDICTS
    assert "b.inertia" not in grade.sentence


def test_all_counts_of_what_is_identified_are_one():
    estimate = estimated()
    shown = Estimates(parameter_rows(estimate, {}))
    assert int(estimate.identified.sum()) == 2
    (number,) = parameter_numbers(shown)
    assert number.value.split()[0] == identified_phrase(shown).split()[0] == "2"
