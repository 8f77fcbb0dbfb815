"""Lines that tell too little of an input: found by the estimate's own variance, left out, listed, refused last."""

from dataclasses import replace

import numpy as np
import pytest

from robid.artifacts.artifact import Provenance
from robid.artifacts.kinds import FRF, frf_from_artifact, frf_to_artifact
from robid.artifacts.store import read_artifact, write_artifact
from robid.errors import DataError
from robid.frf.distortion import completed, weak_inputs
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.frf.residual import LOGARITHM
from robid.frf.residual import PLAIN as DIFFERENCE
from robid.models.elastic.fit.options import Weights
from robid.models.elastic.fit.weights import make_weights
from robid.signals.quantities import motor_channels
from robid.signals.record import Record
from robid.signals.waveforms import multisine, time_signal

STEP_S, N_SAMPLE = 0.01, 1000
LINES = np.arange(21, 221, 4)
NOTCH = [10, 11, 30]
PLAIN = EstimateOptions(compensation="none")


def exact(frequency_hz):
    """Two masses on a common spring to the ground, torque to acceleration (n_freq, 2, 2)."""
    omega = 2 * np.pi * frequency_hz[:, None, None]
    mass, stiffness = np.array([[2.0, 0.4], [0.4, 1.0]]), 900 * np.array([[1.0, 0.3], [0.3, 0.8]])
    return -(omega**2) * np.linalg.inv(-(omega**2) * mass + 0.4j * omega * np.eye(2) + stiffness)


def record(notch=(), *, size=3e-6, noise=3e-5, realizations=3, periods=3, seed=0):
    """Steady state of orthogonal blocks, noise on torque and angle, the second motor's torque weak at some lines."""
    generator = np.random.default_rng(seed)
    amplitude = np.ones((2, LINES.size))
    amplitude[1, list(notch)] = size
    phases = generator.uniform(0, 2 * np.pi, (realizations, 2, LINES.size))
    spectrum = multisine(amplitude, phases)
    frequency_hz = LINES / (N_SAMPLE * STEP_S)
    motion = np.einsum("koi,reki->reko", exact(frequency_hz), spectrum)
    motion = -motion / (2 * np.pi * frequency_hz[:, None]) ** 2
    shape = (realizations, 2, periods, N_SAMPLE, 2)
    torque, angle = (time_signal(one, LINES, N_SAMPLE)[:, :, None] for one in (spectrum, motion))
    return Record(
        sampling_period_s=STEP_S,
        configurations=np.zeros((1, 2)),
        inputs=(torque + 30 * noise * generator.standard_normal(shape))[None],
        outputs=(angle + noise * generator.standard_normal(shape))[None],
        excited_lines=LINES,
        input_channels=motor_channels(("first", "second"), "torque"),
        output_channels=motor_channels(("first", "second"), "angle"),
        output_offset=np.zeros((1, 2)),
    )


@pytest.mark.parametrize("estimator", ["logarithmic", "h1", "local_periodic"])
def test_a_notch_of_one_motor_costs_its_responses_there_and_no_others(estimator):
    options = replace(PLAIN, estimator=estimator)
    if estimator == "local_periodic":
        options = replace(options, local_order=0, local_half_width_lines=0)
    frf = estimate_frf(record(NOTCH), options)
    lost = np.zeros((LINES.size, 2), bool)
    lost[NOTCH, 1] = True
    np.testing.assert_array_equal(frf.dropped[0], lost)
    assert np.isinf(frf.element_variance()[0][lost[:, None].repeat(2, axis=1)]).all()
    assert np.isinf(frf.error_radius(0.95)[0, 10, :, 1]).all()
    told = [note for note in frf.notes if "too little is known" in note]
    assert "of second at 3 of 50 lines (6.1, 6.5, 14.1 Hz)" in told[0]
    whole = exact(frf.frequency_hz)
    inside = np.abs(frf.response[0] - whole) <= frf.error_radius(0.95)[0]
    assert inside.mean() > 0.9
    near = np.abs(frf.response[0] / whole - 1)
    assert near[NOTCH, :, 1].max() < 0.5  # what stands there is interpolated, not noise over noise
    assert not estimate_frf(record(), options).dropped.any()


@pytest.mark.parametrize("periods", [1, 3])
def test_lines_without_any_power_are_left_out_of_an_exact_record(periods):
    frf = estimate_frf(record(NOTCH, size=0.0, noise=0.0, realizations=1, periods=periods), PLAIN)
    assert frf.dropped.sum() == 2 * len(NOTCH)  # neither motor's response can be solved there
    kept = ~frf.dropped[0].any(axis=1)
    np.testing.assert_allclose(frf.response[0][kept], exact(frf.frequency_hz)[kept], rtol=1e-8)
    assert frf.lines.tolist() == LINES.tolist()


def test_too_little_left_is_refused_with_what_is_needed():
    with pytest.raises(DataError, match=r"2 of 50 lines .* tell enough .* 4 are needed"):
        estimate_frf(record().realizations(1), replace(PLAIN, weak_line_std=_between(record().realizations(1), 2)))
    with pytest.raises(DataError, match=r"do not excite every motor at .*: 0 of 50 lines tell all of them apart"):
        estimate_frf(replace(record(), inputs=np.zeros_like(record().inputs)), PLAIN)


def _between(one, count):
    """A limit that leaves that many lines."""
    frf = estimate_frf(one, replace(PLAIN, weak_line_std=1e9))
    limits = np.geomspace(1e-6, 1, 4000)
    kept = [(~weak_inputs(frf.response[0], frf.element_variance()[0], limit)).sum(axis=0).max() for limit in limits]
    return float(limits[kept.index(count)])


def test_an_antiresonance_is_no_weak_line():
    frequency = np.linspace(1, 20, 200)
    response = (1 - (frequency / 9.98) ** 2 + 1e-4j)[:, None, None]
    variance = np.full(response.shape, 0.05**2)
    assert np.abs(response).min() < 0.01  # less than its deviation
    assert not weak_inputs(response, variance, 0.5).any()
    assert weak_inputs(response, 1e4 * variance, 0.5).any()


def test_fits_do_not_see_what_was_left_out():
    frf = estimate_frf(record(NOTCH), PLAIN)
    wild = frf.response.copy()
    wild[0, NOTCH, :, 1] *= 1e3
    for residual, weights in ((LOGARITHM, Weights()), (DIFFERENCE, Weights(kind="user"))):
        for each in (frf, replace(frf, response=wild)):
            weight, _ = make_weights(each, weights, residual)
            assert not weight[0, NOTCH, :, 1].any()
            assert weight[0, NOTCH, :, 0].any()


def test_the_artifact_lists_what_was_left_out(tmp_path):
    frf = estimate_frf(record(NOTCH), PLAIN)
    write_artifact(tmp_path / "frf.h5", frf_to_artifact(frf, Provenance(stage="estimate-frf")))
    back = frf_from_artifact(read_artifact(tmp_path / "frf.h5", FRF))
    np.testing.assert_array_equal(back.dropped, frf.dropped)
    assert back.dropped.dtype == bool


def test_lines_between_stay_apart_in_the_correlation():
    frf = estimate_frf(record(), replace(PLAIN, estimator="local_periodic", local_half_width_lines=4))
    kept = np.delete(np.arange(LINES.size), [20])
    part = replace(
        frf,
        **{name: getattr(frf, name)[:, kept] for name in ("response", "input_factor", "total_covariance", "coherence")},
        lines=frf.lines[kept],
        frequency_hz=frf.frequency_hz[kept],
        noise_covariance=None,
        sensitivity=frf.sensitivity[:, :, kept],
        line_correlation=frf.line_correlation[:, kept],
    )
    dropped = np.zeros((LINES.size, 2), bool)
    dropped[20] = True
    whole = completed(part, dropped, LINES, frf.frequency_hz, frf.input_amplitude[0], frf.line_correlation.shape[2])
    found, own = whole.line_correlation[0], part.line_correlation[0]
    np.testing.assert_array_equal(found[:10, : own.shape[1]], own[:10])
    assert found[19, 0] == 0
    assert not found[20].any()
    assert found[19, 1] == own[19, 0]
    assert found[18, 2] == own[18, 1]
    assert np.isnan(whole.coherence[0, 20]).all()
