"""A fit of all channels: what goes in, what comes out, and when a search that stalled has converged."""

from dataclasses import replace

import numpy as np
import pytest

from external_loops import BANDS, PERIOD_S, channels, linear, shot_of
from robid.errors import DataError
from robid.models.external.fit.fitting import fit_external, settled
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.fit.output_error import fit_block
from robid.models.external.fit.problem import Structure
from tolerances import RECOVERY_SIGMA

PLANT = linear([3.0, 400.0], [1.0, 22.0, 400.0], 3)
OPTIONS = ExternalOptions(poles=2, zeros=1, delay_samples=3)
PORTS = channels(("X", "Y"), "position_command"), channels(("X", "Y"))


@pytest.fixture(scope="module")
def shots():
    return [shot_of([PLANT, PLANT], band) for band in BANDS]


def test_known_poles_come_back_and_what_rested_is_left_out(shots):
    found = fit_external(shots, *PORTS, "zoh", OPTIONS)
    estimate = found.estimate
    assert found.transfers.names == ("X",)
    assert [each.kind for each in found.findings] == ["left_out"]
    truth = {"X.gain": 1.0, "X.zero1": 400 / 3, "X.pole1.frequency": 20.0, "X.pole1.damping": 0.55}
    assert set(estimate.names) == set(truth)
    std = np.sqrt(np.diag(estimate.covariance))
    for name, value, deviation in zip(estimate.names, estimate.value, std, strict=True):
        assert abs(value - truth[name]) < RECOVERY_SIGMA * deviation
    assert estimate.identifiable.all()
    assert [one.place for one in found.agreements] == ["1.04 Hz", "5.2 Hz"]
    assert found.quality.fpe[0] < 1e-5
    simulated = found.traces.measured - found.traces.simulated
    np.testing.assert_allclose(simulated.std(), np.mean([one.error_std for one in found.agreements]), rtol=0.1)
    low, high = found.quality.lowest_hz[0], found.quality.highest_hz[0]
    assert low < 0.05 < 4 < high


def test_records_of_other_rates_are_refused(shots):
    other = [shots[0], replace(shots[1], sampling_period_s=2 * PERIOD_S)]
    with pytest.raises(DataError, match=r"sampled every 0.012 and every 0.024 s"):
        fit_external(other, *PORTS, "zoh", OPTIONS)


def test_a_search_that_stalled_where_there_is_no_better_has_converged(shots):
    fit = replace(fit_block(shots, [0], [0], Structure(2, 1, 3)), status="stalled")
    assert settled(fit, fit).status == "converged"
    worse = replace(fit, log_likelihood=fit.log_likelihood - 5)
    assert settled(fit, worse) == replace(fit, status="converged")
    assert settled(worse, fit) is fit, "a second search that finds better shows that the first had not"


def test_every_shot_is_held_with_what_was_measured(shots):
    long = [replace(each, name=f"{each.name} {turn}") for turn in range(6) for each in shots]
    assert sum(len(each.outputs) for each in long) > 20_000
    found = fit_external(long, *PORTS, "zoh", OPTIONS).traces
    assert set(found.shot.tolist()) == set(range(len(long)))


def test_few_lines_tell_nothing_of_coupling_and_keep_responses(shots):
    n_sample = len(shots[0].outputs)
    time = np.arange(n_sample) / n_sample
    command = 0.01 * sum(np.cos(2 * np.pi * line * time + line**2) for line in (5, 20, 60, 110, 160))
    answer = PLANT(np.tile(command, 3))[-n_sample:]
    noise = 1e-6 * np.random.default_rng(1).standard_normal((n_sample, 2))
    sparse = replace(
        shots[0],
        inputs=np.stack([command, 0 * command], axis=1),
        outputs=np.stack([answer, 0 * answer], axis=1) + noise,
        start="periodic",
        noise_std=np.full(2, 1e-6),
    )
    found = fit_external([sparse], *PORTS, "zoh", OPTIONS)
    assert np.isfinite(found.responses.response).all()
    assert "too few lines to tell" in found.coupling.sentence
