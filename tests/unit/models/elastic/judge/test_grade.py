"""Three grades: each reason takes a model down to its own, and the causes keep their order."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.grading import grade_fit, grade_validation
from robid.results.finding import CAUSES, Finding
from robid.results.grade import ordered
from solutions import with_estimate

FREQUENCY_HZ = np.geomspace(1, 60, 30)
PLACES = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2], [-1.1, 0.3]])
FAINT = Finding("payload", "the payload +0.01 kg", decisive=False, strength=0.3)
CLEAR = Finding("payload", "the payload +2 kg", decisive=False, strength=4.0)
DECISIVE = Finding("torque_sign", "shoulder: its torque has the wrong sign", decisive=True, strength=9.0)


@pytest.fixture(scope="module")
def sound():
    frf = exact_frf(two_joint_robot(), PLACES, FREQUENCY_HZ, delay_s=1e-3, relative_noise=0.003, seed=3)
    return fit_elastic(two_joint_robot(), frf, ElasticOptions(), 1e-3)


@pytest.mark.parametrize(
    ("findings", "failures", "value"),
    [
        ((), (), 2),
        ((FAINT,), (), 2),
        ((CLEAR,), (), 1),
        ((), ("resonances are off",), 0),
        ((DECISIVE,), (), 0),
        ((DECISIVE, CLEAR), ("resonances are off",), 0),
    ],
)
def test_the_worst_reason_decides(sound, findings, failures, value):
    grade = grade_validation(sound, findings, failures)
    assert grade.value == value
    assert grade.findings == findings
    assert grade_fit(sound, findings).value == min(value, 1) or failures


def test_a_fit_alone_predicts_at_best(sound):
    grade = grade_fit(sound, ())
    assert grade.value == 1
    assert grade.sentence == (
        "Predicts, but single parameters may be off: it was not validated on data that the fit never saw."
    )


@pytest.mark.parametrize(
    ("clusters", "told"),
    [
        (1, "all was measured in a single cluster of configurations, and fewer than 4 do not show"),
        (3, "all was measured in 3 clusters of configurations, and fewer than 4 do not show"),
        (4, ""),
    ],
)
def test_a_fit_of_fewer_than_four_clusters_is_not_trusted_and_says_how_many_are_missing(sound, clusters, told):
    measured = replace(sound.responses, configurations=PLACES[np.arange(5) % clusters])
    grade = grade_validation(replace(sound, responses=measured), (), ())
    assert grade.value == (1 if told else 2)
    assert told in grade.sentence
    missing = {1: "measure 3 more configurations", 3: "measure 1 more configuration.", 4: "Trust"}
    assert missing[clusters] in grade.sentence


def test_what_a_fit_cannot_be_used_for(sound):
    assert grade_validation(with_estimate(sound, status="iteration_limit"), (), ()).value == 0
    assert (
        grade_validation(
            replace(sound, costs=replace(sound.costs, dropped=int(0.6 * sound.responses.modelled.size))), (), ()
        ).value
        == 0
    )
    value = sound.estimate.value
    unknown = with_estimate(sound, lower=value - 100 * value, upper=value + 100 * value)
    grade = grade_validation(unknown, (), ())
    assert grade.value == 0
    assert "no spring is known to better than its own size" in grade.sentence


def test_misfit_and_telling_residuals_cost_trust(sound):
    assert grade_validation(replace(sound, misfit=1.6), (), ()).value == 1
    error = sound.model_error
    for level, value in ((5e-4, 2), (0.02, 1)):  # what moves no spring beyond its interval counts for nothing
        beyond = replace(error, ratio=error.limit + 1, level=np.full_like(error.level, level))
        assert grade_validation(replace(sound, model_error=beyond), (), ()).value == value


def test_the_sentence_names_the_first_cause_once(sound):
    sentence = grade_validation(sound, (DECISIVE, CLEAR), ()).sentence
    assert sentence.startswith("Do not use: shoulder: its torque has the wrong sign.")
    assert sentence.count(DECISIVE.message) == 1
    assert f"Look first for {CAUSES['torque_sign']}." in sentence


def test_no_cause_is_told_twice_and_decisive_ones_are_kept():
    again = replace(CLEAR, message="weighed: the payload +2.1 kg")
    assert ordered((CLEAR, again, DECISIVE)) == (CLEAR, DECISIVE)
    decisive = replace(again, decisive=True)
    assert ordered((CLEAR, DECISIVE, decisive)) == (decisive, DECISIVE)
