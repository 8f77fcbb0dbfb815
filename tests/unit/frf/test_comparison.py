"""Responses held against each other: what agrees by construction agrees, what does not is found, by its size."""

from dataclasses import replace

import numpy as np
import pytest

from robid.errors import DataError
from robid.frf.comparison import align, compare, pair_configurations
from robid.signals.quantities import Channel
from sample_reports import synthetic_frf

NAMES = ("turn", "lift")
LINES = np.arange(10.0, 40.0)


def resonance(frequency_hz):
    """Two coupled masses (1, n_freq, 2, 2), wide enough for lines 1 Hz apart."""
    s = 2j * np.pi * np.asarray(frequency_hz)
    mode = s**2 / (s**2 + 60.0 * s + 120.0**2)
    shape = np.array([[1.0, -2.0], [-2.0, 4.0]])
    return (np.array([[3.0, 1.0], [1.0, 2.0]]) + mode[:, None, None] * shape)[None]


def measured(seed, frequency_hz=LINES, *, change=1.0, freedom=8.0, pooled=False, relative=0.01, truth=None):
    """A response with noise, whose variances are estimates with these degrees of freedom."""
    truth = resonance(frequency_hz) * change if truth is None else truth
    frf = synthetic_frf(truth, np.asarray(frequency_hz, float), np.zeros((len(truth), 1)), relative, NAMES, NAMES, seed)
    generator = np.random.default_rng([seed, 7])
    level = relative * np.median(np.abs(truth), axis=-1)
    noise = generator.normal(size=(2, *truth.shape)) / np.sqrt(2)
    draw = generator.chisquare(2 * freedom, (len(truth), 1 if pooled else len(frequency_hz))) / (2 * freedom)
    covariance = np.zeros_like(frf.total_covariance)
    covariance[..., [0, 1], [0, 1]] = draw[..., None] * level**2
    return replace(
        frf,
        response=truth + level[..., None] * (noise[0] + 1j * noise[1]),
        total_covariance=covariance,
        total_degrees_of_freedom=freedom,
    )


@pytest.mark.parametrize(("freedom", "pooled"), [(2.0, False), (2.0, True), (8.0, False), (30.0, True)])
def test_responses_that_agree_are_said_to_differ_in_one_of_twenty(freedom, pooled):
    trials = [
        compare(*(measured(2 * seed + one, freedom=freedom, pooled=pooled) for one in (0, 1))) for seed in range(300)
    ]
    alarms = np.mean([not trial.agree for trial in trials])
    # Two variances of two degrees each, drawn anew for every line, average out: the limit errs towards agreement.
    assert alarms < 0.05 + 3 * np.sqrt(0.05 * 0.95 / 300)
    within = np.mean([element.share_within for trial in trials for element in trial.elements])
    assert within == pytest.approx(0.95, abs=0.02)


def test_a_difference_is_found_with_its_size():
    found = compare(measured(1), measured(2, change=1.05 * np.exp(1j * np.deg2rad(3.0))))
    assert found.agree is False
    for element in found.elements:
        assert element.agrees is False
        assert element.decibels == pytest.approx(20 * np.log10(1.05), abs=0.06)
        assert element.degrees == pytest.approx(3.0, abs=0.5)
        assert element.relative == pytest.approx(abs(1.05 * np.exp(1j * np.deg2rad(3.0)) - 1), rel=0.15)
        assert element.share_within < 0.2
        assert element.ratio > 5 * element.limit


def test_the_ratio_is_the_mean_square_over_the_sum_of_variances():
    first, second = measured(1), measured(2)
    square = np.abs(second.response - first.response) ** 2
    expected = (square / (first.element_variance() + second.element_variance()))[0].mean(axis=0)
    ratio = np.array([element.ratio for element in compare(first, second).elements])
    np.testing.assert_allclose(ratio, expected.ravel(), rtol=1e-12)


def test_lines_that_overlap_count_as_fewer():
    first, second = measured(1), measured(2)
    shared = replace(first, line_correlation=np.full((1, len(LINES), 2), 0.7))
    for alone, overlapping in zip(compare(first, second).elements, compare(shared, second).elements, strict=True):
        assert overlapping.limit > alone.limit
        assert overlapping.ratio == alone.ratio


def test_dropped_lines_count_nowhere():
    dropped = np.zeros((1, len(LINES), 2), bool)
    dropped[0, 4:9, 0] = True
    wild = measured(2)
    wild.response[0, 4:9, :, 0] = 1e3
    found = compare(measured(1), replace(wild, dropped=dropped))
    assert [element.lines for element in found.elements] == [25, 30, 25, 30]
    assert found.agree


@pytest.mark.parametrize("swapped", [False, True])
def test_the_denser_response_is_interpolated_to_the_others_lines(swapped):
    dense, sparse = measured(1, np.arange(5.0, 50.0, 0.5)), measured(2, np.arange(10.25, 40.0, 2.0))
    found = compare(sparse, dense) if swapped else compare(dense, sparse)
    aligned = found.aligned
    assert aligned.how == ("second" if swapped else "first")
    np.testing.assert_array_equal(aligned.frequency_hz, sparse.frequency_hz)
    between = aligned.second if swapped else aligned.first
    np.testing.assert_allclose(between, resonance(sparse.frequency_hz), atol=0.1)
    assert found.agree
    other = compare(dense, measured(2, np.arange(10.25, 40.0, 2.0), change=1.1))
    assert other.agree is False


def test_interpolation_over_a_sharp_resonance_is_no_difference():
    """What lines too far apart cannot tell counts as uncertainty, not as a difference."""
    s = 2j * np.pi
    sharp = [
        (s * at) ** 2 / ((s * at) ** 2 + 1.0 * s * at + (2 * np.pi * 20.3) ** 2)
        for at in (np.arange(10.0, 40.0, 1.0), np.arange(10.5, 40.0, 1.0))
    ]
    first, second = (
        measured(seed, np.arange(10.0 + seed / 2, 40.0, 1.0), truth=one[None, :, None, None] * np.ones((2, 2)))
        for seed, one in enumerate(sharp)
    )
    found = compare(first, second)
    assert found.aligned.how != "common"
    assert found.agree


def test_common_lines_are_used_where_there_are_enough():
    first, second = measured(1, np.arange(10.0, 40.0)), measured(2, np.arange(10.0, 40.0, 3.0))
    assert align(first, second).how == "common"
    np.testing.assert_array_equal(align(first, second).frequency_hz, second.frequency_hz)


def test_configurations_are_paired_by_position():
    truth = np.concatenate([resonance(LINES) * scale for scale in (1.0, 2.0, 3.0)])
    first = replace(measured(1, truth=truth), configurations=np.array([[0.1], [0.2], [0.3]]))
    second = replace(measured(2, truth=truth[[2, 0, 1]]), configurations=np.array([[0.3], [0.1], [0.7]]))
    assert pair_configurations(first, second) == ((0, 1), (2, 0))
    found = compare(first, second)
    assert found.agree
    assert len(found.each) == 2
    assert any("2 of 3 and 3 configurations" in note for note in found.notes)
    assert found.elements[0].lines == 2 * len(LINES)


def test_two_single_configurations_belong_together_and_it_is_said():
    elsewhere = replace(measured(2), configurations=np.array([[0.5]]))
    assert "They were measured at different joint positions." in compare(measured(1), elsewhere).notes


def test_elements_are_matched_by_name():
    one, two = measured(1), measured(2)
    swapped = replace(
        two, response=two.response[:, :, ::-1], output_channels=two.output_channels[::-1],
        total_covariance=two.total_covariance[:, :, ::-1, ::-1],
    )  # fmt: skip
    assert compare(one, swapped).elements == compare(one, two).elements
    part = replace(two, output_channels=(two.output_channels[0], replace(two.output_channels[1], name="other")))
    found = compare(one, part)
    assert [(element.output, element.input) for element in found.elements] == [("turn", "turn"), ("turn", "lift")]
    assert "Only one of them has the outputs lift, other." in found.notes


def test_without_a_covariance_only_sizes_are_told():
    bare = replace(measured(2), total_covariance=None, noise_covariance=None)
    found = compare(measured(1), bare)
    assert found.agree is None
    for element in found.elements:
        assert np.isnan([element.ratio, element.share_within, element.limit]).all()
        assert np.isfinite([element.decibels, element.degrees, element.relative]).all()
    assert any("covariances differ: noise and distortion and unknown" in note for note in found.notes)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        (
            {"output_channels": (Channel("turn", "angle", "rad"), Channel("lift", "angle", "rad"))},
            "output `turn` is motor acceleration [rad/s^2] in the first, but motor angle [rad] in the second; D008"
            " output `lift` is",
        ),
        (
            {"input_channels": (Channel("turn", "current", "A"), Channel("lift", "torque", "N m"))},
            "input `turn` is motor torque [N m] in the first, but motor current [A] in the second",
        ),
        (
            {"input_channels": (Channel("a", "torque", "N m"), Channel("b", "torque", "N m"))},
            "D009 they have no input in common (turn, lift and a, b)",
        ),
        ({"frequency_hz": LINES + 100}, "D010 their bands do not overlap: 10 to 39 Hz and 110 to 139 Hz"),
    ],
)
def test_what_cannot_be_compared_is_said_by_name(changed, words):
    with pytest.raises(DataError) as caught:
        compare(measured(1), replace(measured(2), **changed))
    assert words in caught.value.what
    assert caught.value.remedy


def test_configurations_without_a_common_one_are_refused():
    truth = np.concatenate([resonance(LINES)] * 2)
    first = replace(measured(1, truth=truth), configurations=np.array([[0.1], [0.2]]))
    second = replace(measured(2, truth=truth), configurations=np.array([[0.3], [0.4]]))
    with pytest.raises(DataError, match="D007 none of the 2 and 2 configurations"):
        compare(first, second)
    with pytest.raises(DataError, match="1 joints in its configurations, the other 2"):
        compare(first, replace(second, configurations=np.zeros((2, 2))))
