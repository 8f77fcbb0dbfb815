"""Intervals of measured resonances hold what repeated measurements of a simulated drive with friction scatter."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_mass_robot, with_arm_friction, with_spring_factors
from robid.arrays import places_of
from robid.frf.estimate import estimate_frf
from robid.frf.frf import Frf
from robid.frf.options import EstimateOptions
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.extrema import Elements, pair_extrema
from robid.models.elastic.judge.fitted import fitted_model
from robid.models.elastic.judge.resonances import tabulate_resonances
from rubbing_drive import measure

PLAIN = EstimateOptions(compensation="none")
DRIVE = with_arm_friction(two_mass_robot(damping=0.05, viscous=0.06), 0.08)
OPTIONS = ElasticOptions(
    free=("stiffness", "damping", "viscous", "arm_viscous", "motor_inertia", "link_inertia", "delay")
)
REPETITIONS = 60
KINDS = ("antiresonance", "resonance")


def responses(**measured):
    return [estimate_frf(record, PLAIN) for record in measure(DRIVE, REPETITIONS, **measured)]


def tables(frfs):
    solution = fit_elastic(DRIVE, frfs[0], OPTIONS, 0.0)
    return [tabulate_resonances(DRIVE, solution, frf, OPTIONS, 0.0) for frf in frfs]


@pytest.mark.parametrize(
    ("realizations", "dry_nm"),
    [(1, 0.1), *(pytest.param(*each, marks=pytest.mark.slow) for each in ((2, 0.1), (4, 0.1), (1, 0.3)))],
)
def test_an_interval_holds_the_mean_of_all_measurements_about_as_often_as_it_says(realizations, dry_nm):
    """With friction: a share of the torque is dry friction, whose distortion differs with the signal's phases."""
    found = tables(responses(realizations=realizations, dry_nm=dry_nm, seed=21))
    alike = [table for table in found if table.kind == KINDS]
    assert len(alike) >= (0.95 if dry_nm > 0.1 else 1.0) * len(found), "bumps of a distortion are no resonances"
    for lower, middle, upper in (
        ("lower_hz", "measured_hz", "upper_hz"), ("pole_lower_hz", "pole_hz", "pole_upper_hz"),
    ):  # fmt: skip
        low, hz, high = (np.array([getattr(table, key) for table in alike]) for key in (lower, middle, upper))
        there = np.isfinite(hz)
        assert (there.mean(axis=0) > 0.95).all()
        mean, count = np.nanmean(hz, axis=0), there.sum(axis=0)
        held = ((low <= mean) & (mean <= high)).sum(axis=0) / count
        # Four deviations of a share of sixty.
        assert (np.abs(held - 0.95) <= 4 * np.sqrt(0.95 * 0.05 / count)).all(), (middle, held)
        # Nor is it so wide that it holds everything: half of it is not above five deviations.
        assert (0.5 * np.nanmedian(high - low, axis=0) < 5 * np.nanstd(hz, axis=0)).all()


def test_noise_alone_is_not_what_one_realization_scatters():
    frfs = responses(realizations=1)
    solution = fit_elastic(DRIVE, frfs[0], OPTIONS, 0.0)
    reach = {False: [], True: []}
    for frf in frfs[:5]:
        fitted = fitted_model(DRIVE, solution, frf, OPTIONS, 0.0)
        for scattering, found in reach.items():
            element = Elements(fitted, frf, scattering=scattering).at(0, 0, 0)
            pairs = [pair for pair in pair_extrema(element, "resonance") if 75 < pair.measured_hz < 78]
            found.append(pairs[0].measured.peak_std_hz)
    assert np.median(reach[True]) > 10 * np.median(reach[False])


def test_bumps_of_a_distortion_are_no_resonances():
    frfs = [estimate_frf(record, PLAIN) for record in measure(DRIVE, 4, 1, dry_nm=0.25)]
    solution = fit_elastic(DRIVE, frfs[0], OPTIONS, 0.0)
    for frf in frfs:
        table = tabulate_resonances(DRIVE, solution, frf, OPTIONS, 0.0)
        assert table.kind == KINDS
    bumps = [
        len(pair_extrema(Elements(fitted_model(DRIVE, solution, frf, OPTIONS, 0.0), frf).at(0, 0, 0), "resonance"))
        for frf in frfs
    ]
    assert max(bumps) > 1, "to the noise of the periods alone they are some"


def test_configurations_that_repeat_each_other_widen_the_interval():
    """Four measurements of one place between which the coupling warmed up, each with little noise."""
    robots = [with_spring_factors(DRIVE, factor) for factor in (0.98, 1.0, 1.01, 1.03)]
    each = [
        exact_frf(robot, [[0.0]], np.arange(11.0, 251.0), sampling_period_s=4e-4, relative_noise=1e-4, seed=seed)
        for seed, robot in enumerate(robots)
    ]
    held = {name: [getattr(frf, name) for frf in each] for name in places_of(Frf, "configuration")}
    joined = {name: np.concatenate(parts) for name, parts in held.items() if parts[0] is not None}
    whole = replace(each[0], **joined)
    solution = fit_elastic(DRIVE, whole, OPTIONS, 0.0)
    table = tabulate_resonances(DRIVE, solution, whole, OPTIONS, 0.0)
    assert table.kind == KINDS * 4
    for first in (0, 1):
        hz, half = table.measured_hz[first::2], 0.5 * (table.upper_hz - table.lower_hz)[first::2]
        # Student's quantile of three degrees of freedom times the sample's deviation.
        np.testing.assert_allclose(half, 3.18 * hz.std(ddof=1), rtol=0.01)
    apart = replace(whole, configurations=np.array([[0.0], [0.1], [0.2], [0.3]]))
    lone = tabulate_resonances(DRIVE, fit_elastic(DRIVE, apart, OPTIONS, 0.0), apart, OPTIONS, 0.0)
    assert (lone.upper_hz - lone.lower_hz).max() < 0.1 * (table.upper_hz - table.lower_hz).min()
