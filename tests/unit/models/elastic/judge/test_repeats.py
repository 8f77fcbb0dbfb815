"""Resonances of campaigns that measured one configuration, pooled."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t

from exact_systems import exact_frf, two_mass_robot, with_arm_friction, with_spring_factors
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.resonances import Measured, ResonanceTable, pool_repeats, tabulate_resonances

DRIVE = with_arm_friction(two_mass_robot(damping=0.05, viscous=0.06), 0.08)
OPTIONS = ElasticOptions(free=("stiffness", "damping", "viscous", "arm_viscous", "motor_inertia", "link_inertia"))
HZ = np.arange(41.0, 101.0)
HALF_HZ = 0.02


def table(peaks_hz, poles_hz=None, half_hz=HALF_HZ, kind="resonance"):
    peaks = np.array(peaks_hz, float)
    poles, nowhere = np.array(peaks if poles_hz is None else poles_hz, float), np.full(peaks.size, np.nan)
    return ResonanceTable(
        configuration=np.zeros(peaks.size, int),
        channel=("drive",) * peaks.size,
        kind=(kind,) * peaks.size,
        measured_hz=peaks,
        lower_hz=peaks - half_hz,
        upper_hz=peaks + half_hz,
        **dict.fromkeys(("model_hz", "mode_hz", "mode_lower_hz", "mode_upper_hz", "damping"), nowhere),
        pole_hz=poles,
        pole_lower_hz=poles - half_hz,
        pole_upper_hz=poles + half_hz,
    )


def measured(name, peaks_hz, at=0.0, **rest):
    return Measured(table(peaks_hz, **rest), np.array([[at]]), (name,))


def width(found):
    return found.upper_hz - found.lower_hz


def test_three_logs_that_lie_apart_widen_the_interval_to_their_scatter():
    peaks = [76.0, 76.4, 76.8]
    days = [measured(name, [hz]) for name, hz in zip(("one", "two", "three"), peaks, strict=True)]
    found, (repeat,) = pool_repeats(days[0], days[1:], 0.95)
    deviation = float(np.std(peaks, ddof=1))
    assert repeat.campaigns == ("one", "two", "three")
    assert repeat.mean_hz == pytest.approx([76.4, 76.4])
    # Student's quantile of two degrees of freedom; another log's peak has its own error beside the mean's.
    assert 0.5 * width(found)[0] == pytest.approx(t.ppf(0.975, 2) * deviation, rel=0.01)
    assert repeat.half_hz == pytest.approx(np.full(2, t.ppf(0.975, 2) * deviation * np.sqrt(4 / 3)), rel=0.01)
    assert found.measured_hz == days[0].table.measured_hz


def test_logs_that_agree_keep_their_own_interval():
    found, (repeat,) = pool_repeats(measured("one", [76.0]), [measured("two", [76.0001])], 0.95)
    assert 0.5 * width(found)[0] == pytest.approx(HALF_HZ, rel=1e-3)
    assert repeat.half_hz[0] == pytest.approx(HALF_HZ * np.sqrt(1.5), rel=1e-3)


@pytest.mark.parametrize(
    "other",
    [
        Measured(replace(table([76.8]), configuration=np.array([1])), np.zeros((2, 1)), ("two", "one")),
        measured("two", [76.8], at=0.1),
        measured("two", [85.0]),
        measured("two", [76.8], kind="antiresonance"),
    ],
    ids=["known already", "another place", "another resonance", "a dip"],
)
def test_nothing_else_is_pooled(other):
    own = measured("one", [76.0])
    found, repeats = pool_repeats(own, [other], 0.95)
    assert repeats == ()
    np.testing.assert_allclose(width(found), width(own.table))


def test_what_one_campaign_listed_twice_is_pooled_once():
    both = table([76.0, 76.4])
    own = Measured(replace(both, configuration=np.array([0, 1])), np.zeros((2, 1)), ("one", "one"))
    found, (repeat,) = pool_repeats(own, [], 0.95)
    assert (repeat.row, repeat.campaigns) == (0, ("one", "one"))
    np.testing.assert_allclose(width(found), width(both), err_msg="the fit has widened them already")


def test_the_nearest_of_each_campaign_counts():
    _, repeats = pool_repeats(measured("one", [76.0, 78.0]), [measured("two", [76.1, 78.1])], 0.95)
    np.testing.assert_allclose([repeat.peaks_hz for repeat in repeats], [[76.0, 76.1], [78.0, 78.1]])


def test_poles_that_one_campaign_alone_has_are_not_pooled():
    found, (repeat,) = pool_repeats(measured("one", [76.0]), [measured("two", [76.8], poles_hz=[np.nan])], 0.95)
    assert np.isnan(repeat.mean_hz[1])
    assert np.isnan(repeat.half_hz[1])
    assert found.pole_upper_hz[0] - found.pole_lower_hz[0] == pytest.approx(2 * HALF_HZ)


@pytest.mark.slow
def test_the_pooled_interval_holds_another_campaigns_resonance_about_as_often_as_it_says():
    """Couplings that are 1 % stiffer or softer from day to day, each measured with little noise."""
    generator = np.random.default_rng(9)
    begun = exact_frf(DRIVE, [[0.0]], HZ, sampling_period_s=4e-4, relative_noise=1e-3)
    solution = fit_elastic(DRIVE, begun, OPTIONS, 0.0)

    def day(seed):
        robot = with_spring_factors(DRIVE, 1 + 0.01 * generator.standard_normal())
        frf = exact_frf(robot, [[0.0]], HZ, sampling_period_s=4e-4, relative_noise=1e-3, seed=seed)
        found = tabulate_resonances(DRIVE, solution, frf, OPTIONS, 0.0)
        return Measured(found, frf.configurations, (str(seed),))

    held, alone = [], []
    for trial in range(60):
        *known, new = [day(4 * trial + index) for index in range(4)]
        _, repeats = pool_repeats(known[0], known[1:], 0.95)
        assert len(repeats) == 2
        hz = np.stack([new.table.measured_hz, new.table.pole_hz], axis=1)
        held += [np.abs(hz[repeat.row] - repeat.mean_hz) <= repeat.half_hz for repeat in repeats]
        own = known[0].table
        alone.append((own.lower_hz <= hz[:, 0]) & (hz[:, 0] <= own.upper_hz))
    # Two resonances of one spring move together: four deviations of a share of sixty.
    assert (np.abs(np.mean(held, axis=0) - 0.95) <= 4 * np.sqrt(0.95 * 0.05 / 60)).all()
    assert np.mean(alone) < 0.3, "one log alone cannot know it"
