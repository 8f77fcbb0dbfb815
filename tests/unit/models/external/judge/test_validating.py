"""Transfer functions are trusted where they hold, and not where a robot does what they cannot."""

from dataclasses import replace

import numpy as np
import pytest

from external_loops import BANDS, NEW_BAND, PERIOD_S, channels, limited_rate, linear, play, shot_of
from robid.errors import DataError
from robid.models.external.fit.fitting import fit_external
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.judge.plausible import assess_external, solution_findings
from robid.models.external.judge.validating import validate_external
from robid.results.grade import DO_NOT_USE, PREDICTS, TRUST

KNOWN = ExternalOptions(poles=2, zeros=1, delay_samples=3)
NUMERATOR, DENOMINATOR = [3.0, 400.0], [1.0, 22.0, 400.0]
SOUND = linear(NUMERATOR, DENOMINATOR, 3)


def fitted(plants, names=("X",), options=KNOWN, bands=BANDS):
    shots = [shot_of(plants, band, moving=index) for band in bands for index in range(len(plants))]
    return fit_external(shots, channels(names, "position_command"), channels(names), "zoh", options)


def held(solution, plants, options=KNOWN, band=NEW_BAND, **other):
    new = [shot_of(plants, band, 77, moving=index, **other) for index in range(len(plants))]
    return validate_external(solution, new, assess_external(solution, options).findings)


@pytest.fixture(scope="module")
def sound():
    return fitted([SOUND])


def test_a_right_model_is_trusted_and_its_bounds_hold_what_they_say(sound):
    found = held(sound, [SOUND])
    assert found.outcome.grade.value == TRUST, found.outcome.grade.sentence
    assert found.outcome.ok
    assert found.bounds[0].inside == pytest.approx(0.95, abs=0.02)
    assert found.agreements[0].nrmse > 0.99
    assert found.bounds[0].own_nrmse == pytest.approx(sound.quality.nrmse[0])
    assert found.traces.measured.size == found.traces.std.size == 2500
    assert assess_external(sound, KNOWN).value == PREDICTS, "by itself it predicts at best"


def test_bounds_of_a_single_new_motion_hold_the_noise_that_averaging_took_from_the_fit(sound):
    found = held(sound, [SOUND], repeats=1)
    assert found.bounds[0].inside == pytest.approx(0.95, abs=0.02)


def test_measures_are_those_of_the_table(sound):
    found = held(sound, [SOUND])
    measured, predicted = found.traces.measured, found.traces.predicted
    left = np.sum((measured - predicted) ** 2) / np.sum((measured - measured.mean()) ** 2)
    assert found.agreements[0].r_squared == pytest.approx(1 - left)
    assert found.agreements[0].nrmse == pytest.approx(1 - np.sqrt(left))
    ratio = sound.quality.n_parameter[0] / measured.size
    assert found.bounds[0].fpe == pytest.approx(left * (1 + ratio) / (1 - ratio))


def test_what_is_unstable_comes_to_rest_nowhere():
    options = ExternalOptions(poles=1, zeros=0, delay_samples=3, stable=False)
    messages = " ".join(assess_external(fitted([linear([2.0], [1.0, -0.2], 3)], options=options), options).messages)
    assert "has a pole in the right half plane" in messages
    assert "moves against its command" not in messages
    assert "comes to rest at" not in messages


def test_a_missing_pole_is_a_finding():
    slow = linear(np.multiply(15.0, NUMERATOR), np.polymul(DENOMINATOR, [1.0, 15.0]), 3)
    found = held(fitted([slow]), [slow])
    assert found.outcome.grade.value < TRUST
    assert "what noise and a model error of 1% of the motion explain" in found.outcome.grade.sentence


def test_a_delay_that_is_too_long_is_a_finding():
    options = replace(KNOWN, delay_samples=5)
    found = held(fitted([SOUND], options=options), [SOUND], options)
    assert found.outcome.grade.value < TRUST


def test_a_delay_that_zeros_take_up_is_open():
    # A stated delay that is too short is taken up by a zero without any trace: only a search can tell.
    options = replace(KNOWN, delay_samples=None, max_delay_samples=5)
    solution = fitted([SOUND], options=options)
    near = [one for one in solution.tried if one.poles == 2 and one.zeros == 1 and not one.chosen]
    open_ = min(one.bic for one in near) < next(one.bic for one in solution.tried if one.chosen) + 10
    assert open_ == ("other delays explain X about as well" in " ".join(assess_external(solution, options).messages))
    short = replace(options, max_delay_samples=1)
    longest = assess_external(fitted([SOUND], options=short), short)
    assert "is the longest that was searched" in " ".join(longest.messages)
    assert "raise `max_delay_samples`" in " ".join(longest.messages)


@pytest.mark.parametrize("speed", [0.0, 1e-4])
def test_a_log_that_drifts_makes_no_model_to_be_used(speed):
    def robot(command):
        return SOUND(command) + speed * PERIOD_S * np.arange(len(command))

    options = replace(KNOWN, poles=3, zeros=2)
    found = held(fitted([robot], options=options), [robot], options)
    told = "X has a pole that is too slow for its data" in " ".join(found.outcome.grade.reasons)
    assert told == (speed > 0)
    assert (found.outcome.grade.value == DO_NOT_USE) == (speed > 0)


@pytest.mark.parametrize(
    ("defect", "grade"),
    [(play(2e-4), PREDICTS), (play(2e-3), DO_NOT_USE), (limited_rate(0.02), DO_NOT_USE)],
)
def test_what_is_not_linear_is_not_trusted(defect, grade):
    def robot(command):
        return defect(SOUND(command))

    found = held(fitted([robot]), [robot])
    assert found.outcome.grade.value <= grade


def test_a_limit_that_only_the_new_motion_reaches_fails_it(sound):
    def robot(command):
        return limited_rate(0.02)(SOUND(command))

    found = held(sound, [robot])
    assert not found.outcome.ok
    assert found.outcome.grade.value == DO_NOT_USE
    assert "limit 0.9" in found.outcome.verdict


@pytest.mark.parametrize(("factor", "words"), [(1000.0, "metres were read as millimetres"), (-1.0, "wrong sign")])
def test_wrong_units_and_signs_are_named(factor, words):
    def robot(command):
        return factor * SOUND(command)

    grade = assess_external(fitted([robot]), KNOWN)
    assert grade.value == DO_NOT_USE
    assert words in grade.sentence


@pytest.mark.parametrize(("name", "told"), [("Z", True), ("slide", False)])
def test_poses_of_another_frame_may_be_what_moves_against_its_command(name, told):
    grade = assess_external(fitted([lambda command: -0.8 * SOUND(command)], (name,)), KNOWN)
    assert ("turned by `pose`" in grade.sentence) == told


def test_bounds_that_hold_too_few_samples_are_a_doubt_though_the_error_is_small(sound):
    found = held(sound, [lambda command: 1.007 * SOUND(command)], noise=1e-6)
    assert found.bounds[0].inside < 0.85
    assert found.agreements[0].nrmse > 0.99
    assert found.outcome.grade.value == PREDICTS
    assert "inside the 95% bounds" in found.outcome.grade.sentence


def test_what_noise_explains_is_told_apart_from_what_the_model_lacks(sound):
    tiny = held(sound, [SOUND], band=(2.08, 2e-5))
    assert "which noise explains: move farther" in tiny.outcome.verdict
    assert "noise explains" not in held(sound, [limited_rate(0.02)]).outcome.verdict


def test_a_record_in_other_units_than_the_fits_fails(sound):
    found = held(sound, [lambda command: 57.3 * SOUND(command)])
    assert found.outcome.grade.value == DO_NOT_USE


def test_swapped_channels_fail():
    other = linear([900.0], [1.0, 40.0, 900.0], 3)
    both = [SOUND, other]
    shots = [shot_of(both, band, moving=index) for band in BANDS for index in (0, 1)]
    together = [
        replace(one, inputs=one.inputs + two.inputs[::-1], outputs=one.outputs + two.outputs[::-1])
        for one, two in zip(shots[::2], shots[1::2], strict=True)
    ]
    swapped = [replace(shot, outputs=shot.outputs[:, ::-1]) for shot in together]
    named = channels(("X", "Y"), "position_command"), channels(("X", "Y"))
    one_by_one = [replace(shot, outputs=shot.outputs[:, ::-1]) for shot in shots]
    for wrong in (swapped, one_by_one):
        assert assess_external(fit_external(wrong, *named, "zoh", KNOWN), KNOWN).value == DO_NOT_USE


def test_new_motions_beyond_those_of_the_fit_are_told(sound):
    slow = fitted([SOUND], bands=BANDS[:1])
    faster = held(slow, [SOUND], band=(5.2, 0.02))
    assert "lie outside the band of its fit" in " ".join(faster.outcome.grade.messages)
    larger = held(sound, [SOUND], band=(2.08, 0.1))
    assert "times as large as any of its fit" in " ".join(larger.outcome.grade.messages)
    assert larger.outcome.grade.value == PREDICTS


def test_the_motion_of_the_fit_proves_nothing(sound):
    found = held(sound, [SOUND], band=BANDS[0])
    assert "repeats a motion of the fit" in found.outcome.grade.sentence
    assert found.outcome.grade.value == PREDICTS


def test_coupling_is_a_doubt_of_a_diagonal_fit_and_none_of_a_full_one():
    def run(options):
        shots = [shot_of([SOUND, SOUND], band, moving=index) for band in BANDS for index in (0, 1)]
        mixed = [replace(shot, outputs=shot.outputs + 0.5 * shot.outputs[:, ::-1]) for shot in shots]
        names = ("X", "Y")
        solution = fit_external(mixed, channels(names, "position_command"), channels(names), "zoh", options)
        return solution, assess_external(solution, options)

    solution, grade = run(KNOWN)
    assert "coupling" in grade.causes
    assert "matrix: full" in solution.coupling.sentence
    solution, grade = run(replace(KNOWN, matrix="full"))
    assert "coupling" not in grade.causes
    gains = dict(zip(solution.estimate.names, solution.estimate.value, strict=True))
    assert gains["X.gain"] == pytest.approx(1, abs=1e-3)
    assert gains["Y/X.gain"] == pytest.approx(0.5, abs=1e-3)


def test_what_the_validation_does_not_move_is_told_and_nothing_at_all_refused(sound):
    both = fitted([SOUND, SOUND], ("X", "Y"))
    found = validate_external(both, [shot_of([SOUND, SOUND], NEW_BAND, 77)])
    assert found.untested == ("Y",)
    assert found.outcome.grade.value == PREDICTS
    with pytest.raises(DataError, match="D159"):
        validate_external(sound, [shot_of([SOUND], (2.08, 0.0))])
    with pytest.raises(DataError, match="sampled every"):
        validate_external(sound, [replace(shot_of([SOUND], NEW_BAND), sampling_period_s=PERIOD_S / 3)])


def test_an_order_that_ends_where_the_search_does_is_a_finding():
    late = linear(np.multiply(60.0, NUMERATOR), np.polymul(DENOMINATOR, [1.0, 60.0]), 3)
    for options, told in (
        (ExternalOptions(delay_samples=3, max_poles=2), True),
        (ExternalOptions(delay_samples=3, max_poles=3), False),
        (ExternalOptions(delay_samples=3, max_poles=2, poles=2), False),
        (ExternalOptions(delay_samples=3, max_poles=2, rule="sufficient"), False),
    ):
        findings = solution_findings(fitted([late], options=options), options)
        assert any("took all of `max_poles`" in finding.message for finding in findings) == told
