"""Local models: short records with transients against Welch, the theory's slope, covariance, fewer experiments."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from robid.errors import DataError
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.signals.quantities import motor_channels
from robid.signals.record import Record
from robid.signals.waveforms import multisine, time_signal

STEP_S = 0.01
EVERY_LINE = 1e9  # what noise leaves of a line is what is looked at here
LOCAL = EstimateOptions(estimator="local", compensation="none", weak_line_std=EVERY_LINE)
PERIODIC = EstimateOptions(estimator="local_periodic", compensation="none", weak_line_std=EVERY_LINE)
INERTIA = np.array([[2.0, 0.4], [0.4, 1.0]])


def drive(stiffness=400.0, damping=12.0):
    """Two motors with a common load, exactly discretised: held torque (2) to motor angle (2)."""
    spring = stiffness * np.array([[1.0, 0.3], [0.3, 0.8]])
    rate = damping * np.eye(2)
    inverse = np.linalg.inv(INERTIA)
    a = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ spring, -inverse @ rate]])
    b, c = np.vstack([np.zeros((2, 2)), inverse]), np.hstack([np.eye(2), np.zeros((2, 2))])
    return signal.cont2discrete((a, b, c, np.zeros((2, 2))), STEP_S)[:3]


def drive_response(frequency_hz, plant):
    """Sampled response from torque to acceleration."""
    a, b, c = plant
    omega = 2 * np.pi * frequency_hz
    z = np.exp(1j * omega * STEP_S)[:, None, None]
    angle = c @ np.linalg.solve(z * np.eye(len(a)) - a, np.broadcast_to(b, (omega.size, *b.shape)))
    return -(omega[:, None, None] ** 2) * angle


def played(reference, plant, *, gain=0.0, disturbance=0.0, noise=0.0, seed=0):
    """Torque and measured angle (..., n_sample, 2) from rest, with `u = r - gain * y`; noise acts inside the loop."""
    a, b, c = plant
    generator = np.random.default_rng(seed)
    state = np.zeros((*reference.shape[:-2], len(a)))
    torque, angle = np.empty_like(reference), np.empty_like(reference)
    for k in range(reference.shape[-2]):
        angle[..., k, :] = state @ c.T + noise * generator.standard_normal((*state.shape[:-1], 2))
        torque[..., k, :] = reference[..., k, :] - gain * angle[..., k, :]
        applied = torque[..., k, :] + disturbance * generator.standard_normal((*state.shape[:-1], 2))
        state = state @ a.T + applied @ b.T
    return torque, angle


def as_record(torque, angle, lines, reference=None, periods=1):
    """Signals (n_exp, n_sample, 2) as a record of one realization."""
    n_exp = len(torque)
    shape = (1, 1, n_exp, periods, -1, 2)
    names = ("first", "second")
    return Record(
        sampling_period_s=STEP_S,
        configurations=np.zeros((1, 2)),
        inputs=torque.reshape(shape),
        outputs=angle.reshape(shape),
        reference=None if reference is None else reference[None, None],
        reference_channels=() if reference is None else motor_channels(names, "torque"),
        excited_lines=lines,
        detection_lines=np.zeros(0, int),
        input_channels=motor_channels(names, "torque"),
        output_channels=motor_channels(names, "angle"),
        output_offset=np.zeros((1, 2)),
    )


def band(n_sample, low_hz=1.0, high_hz=8.0):
    """All DFT lines of a band."""
    period_s = n_sample * STEP_S
    return np.arange(round(low_hz * period_s), round(high_hz * period_s) + 1)


def rms_error(response, exact):
    return np.sqrt(np.mean(np.abs(response - exact) ** 2) / np.mean(np.abs(exact) ** 2))


def random_record(n_sample, n_exp=2, seed=0, **loop):
    plant = drive()
    reference = np.random.default_rng(seed).standard_normal((n_exp, n_sample, 2))
    torque, angle = played(reference, plant, seed=seed + 1, **loop)
    closed = loop.get("gain", 0.0) > 0
    return as_record(torque, angle, band(n_sample), reference if closed else None)


def welch_response(record, n_segment):
    """SciPy's Hann-windowed H1 of all experiments, half overlapping; frequencies and response (n_freq, 2, 2)."""
    torque, angle = record.inputs[0, 0, :, 0], record.outputs[0, 0, :, 0]

    def cross(x, y):
        frequency, density = signal.csd(x, y, 1 / STEP_S, "hann", n_segment, axis=0, detrend=False)
        return frequency, density

    s_uu, s_yu = 0.0, 0.0
    for u, y in zip(torque, angle, strict=True):
        pairs = np.array([[cross(u[:, j], y[:, i])[1] for j in range(2)] for i in range(2)])
        own = np.array([[cross(u[:, j], u[:, i])[1] for j in range(2)] for i in range(2)])
        s_yu, s_uu = s_yu + pairs, s_uu + own
    frequency = np.fft.rfftfreq(n_segment, STEP_S)
    angle_response = np.moveaxis(s_yu, 2, 0) @ np.linalg.inv(np.moveaxis(s_uu, 2, 0))
    return frequency, -((2 * np.pi * frequency[:, None, None]) ** 2) * angle_response


def test_ten_decibels_better_than_welch_on_a_short_record():
    record = random_record(1024)
    frf = estimate_frf(record, LOCAL)
    ours = rms_error(frf.response[0], drive_response(frf.frequency_hz, drive()))
    # Welch with the segment length that suits it best.
    theirs = []
    for n_segment in (128, 256, 512, 1024):
        frequency, response = welch_response(record, n_segment)
        chosen = (frequency >= 1.0) & (frequency <= 8.0)
        theirs.append(rms_error(response[chosen], drive_response(frequency[chosen], drive())))
    assert 20 * np.log10(min(theirs) / ours) > 10, (ours, theirs)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_error_falls_with_the_bandwidth_as_theory_says(order):
    """Noise-free, the first term left out is of order R + 1: random spectra do not let the odd terms cancel."""
    sizes = np.array([2048, 4096, 8192])
    errors = []
    for n_sample in sizes:
        frf = estimate_frf(random_record(n_sample), replace(LOCAL, local_order=order, local_half_width_lines=6))
        errors.append(rms_error(frf.response[0], drive_response(frf.frequency_hz, drive())))
    slope = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert abs(-slope - (order + 1)) < 0.5, (errors, slope)


@pytest.mark.parametrize("denominator", [0, 2])
@pytest.mark.parametrize("gain", [0.0, 20.0])
def test_covariance_of_arbitrary_signals_against_monte_carlo(gain, denominator):
    runs, found, claimed = 60, [], []
    options = replace(LOCAL, local_denominator=denominator)
    for seed in range(runs):
        plant = drive()
        reference = np.random.default_rng(5).standard_normal((2, 1024, 2))
        torque, angle = played(reference, plant, gain=gain, disturbance=0.2, seed=seed)
        frf = estimate_frf(as_record(torque, angle, band(1024), reference if gain else None), options)
        found.append(frf.response[0])
        claimed.append(frf.element_variance()[0])
    ratio = np.var(found, axis=0, ddof=1).mean() / np.mean(claimed)
    np.testing.assert_allclose(ratio, 1.0, atol=0.15)


def test_instrument_has_no_bias_where_the_loop_is_closed():
    errors = {}
    plant, exact = drive(), drive_response(band(1024) / (1024 * STEP_S), drive())
    for name in ("instrument", "direct"):
        found = []
        for seed in range(40):
            reference = np.random.default_rng([5, seed]).standard_normal((2, 1024, 2))
            torque, angle = played(reference, plant, gain=300.0, disturbance=2.0, seed=seed)
            known = reference if name == "instrument" else None
            found.append(estimate_frf(as_record(torque, angle, band(1024), known), LOCAL).response[0])
        bias = np.mean(found, axis=0) - exact
        errors[name] = np.mean(np.abs(bias) ** 2) / (np.var(found, axis=0).mean() / len(found))
    assert errors["direct"] > 2 * errors["instrument"], errors


def multisine_record(n_exp, *, spacing=2, noise=0.0, seed=0, realizations=1):
    """Steady state of an orthogonal block of which only the first experiments are played."""
    n_sample, plant = 4000, drive()
    lines = np.arange(41, 321, spacing)
    phases = np.random.default_rng(3).uniform(0, 2 * np.pi, (realizations, 2, lines.size))
    spectrum = multisine(np.ones((2, lines.size)), phases)[:, :n_exp]
    response = drive_response(lines / (n_sample * STEP_S), plant)
    omega = 2 * np.pi * lines / (n_sample * STEP_S)
    angle = time_signal(-np.einsum("koi,reki->reko", response, spectrum) / omega[:, None] ** 2, lines, n_sample)
    torque = time_signal(spectrum, lines, n_sample)
    periods = np.stack([angle, angle], axis=2)
    errors = noise * np.random.default_rng(seed).standard_normal(periods.shape)
    record = as_record(np.tile(torque, (1, 1, 2, 1))[0], periods[0].reshape(n_exp, -1, 2), lines, torque[0], 2)
    shape = (1, realizations, n_exp, 2, n_sample, 2)
    both = np.broadcast_to(torque[:, :, None], shape[1:])[None]
    return replace(record, inputs=both, outputs=(periods + errors)[None], reference=torque[None])


@pytest.mark.parametrize(("order", "denominator"), [(2, 0), (2, 2)])
def test_one_experiment_of_dense_lines_determines_two_motors(order, denominator):
    record = multisine_record(1)
    frf = estimate_frf(record, replace(PERIODIC, local_order=order, local_denominator=denominator))
    exact = drive_response(record.frequency_hz, drive())
    assert rms_error(frf.response[0], exact) < (2e-2 if denominator == 0 else 2e-4)


def test_three_realizations_of_one_experiment_need_no_neighbours():
    record = multisine_record(1, realizations=3)
    frf = estimate_frf(record, replace(PERIODIC, local_order=0, local_half_width_lines=0))
    np.testing.assert_allclose(frf.response[0], drive_response(record.frequency_hz, drive()), rtol=1e-8)


@pytest.mark.parametrize(("denominator", "noise"), [(0, 5e-3), (2, 3e-4)])
def test_covariance_of_fewer_experiments_against_monte_carlo(denominator, noise):
    runs, found, claimed = 80, [], []
    options = replace(PERIODIC, local_denominator=denominator)
    for seed in range(runs):
        frf = estimate_frf(multisine_record(1, noise=noise, seed=seed), options)
        found.append(frf.response[0])
        claimed.append(frf.element_variance()[0])
    spread = np.var(found, axis=0, ddof=1).mean()
    np.testing.assert_allclose(spread / np.mean(claimed), 1.0, atol=0.15)


@pytest.mark.parametrize("estimator", ["local", "local_periodic"])
def test_neighbouring_lines_say_how_much_data_they_share(estimator):
    """A mean over the lines scatters as the lines' correlation says, and not as if they were independent."""
    runs, means, claimed, alone = 80, [], [], []
    for seed in range(runs):
        if estimator == "local":
            reference = np.random.default_rng(5).standard_normal((2, 1024, 2))
            record = as_record(*played(reference, drive(), disturbance=0.2, seed=seed), band(1024))
        else:
            record = multisine_record(1, noise=5e-3, seed=seed)
        frf = estimate_frf(record, replace(LOCAL, estimator=estimator))
        deviation = np.sqrt(frf.element_variance()[0])
        correlation = np.eye(len(deviation))
        for ahead in range(1, 1 + frf.line_correlation.shape[2]):
            here = np.arange(len(deviation) - ahead)
            correlation[here, here + ahead] = correlation[here + ahead, here] = frf.line_correlation[0, here, ahead - 1]
        means.append(frf.response[0].mean(axis=0))
        claimed.append(np.einsum("foi,fl,loi->oi", deviation, correlation, deviation) / len(deviation) ** 2)
        alone.append((deviation**2).sum(axis=0) / len(deviation) ** 2)
    spread = np.var(means, axis=0, ddof=1).mean()
    np.testing.assert_allclose(np.sqrt(spread / np.mean(claimed)), 1.0, atol=0.12)
    assert np.sqrt(spread / np.mean(alone)) > 1.25


def test_scale_of_realizations_gathers_what_errs_alike_in_one():
    """Of distortion that follows the inputs of each realization alike, windows know the variance of every element."""
    runs, found, claimed = 60, [], []
    for seed in range(runs):
        record = multisine_record(2, realizations=4, noise=1e-4, seed=seed)
        share = 0.01 * np.random.default_rng([7, seed]).standard_normal((4, 1, 1, 1, 1))
        own = np.array([1.0, 0.0])  # only the first motor's torque is wrong, by a factor of each realization's own
        frf = estimate_frf(replace(record, inputs=record.inputs * (1 + share * own)), PERIODIC)
        found.append(frf.response[0])
        claimed.append(frf.element_variance()[0])
    spread = np.var(found, axis=0, ddof=1).mean(axis=0)
    stated = np.mean(claimed, axis=(0, 1))
    # The first motor's column errs by its torque's factor; the deviation of 60 runs is known to a tenth.
    np.testing.assert_allclose(np.sqrt(spread[:, 0] / stated[:, 0]), 1.0, atol=0.25)


def test_sparse_lines_are_refused():
    with pytest.raises(DataError, match="D021"):
        estimate_frf(multisine_record(2, spacing=40), LOCAL)


def test_a_window_without_freedom_for_the_model_is_refused():
    with pytest.raises(DataError, match="no freedom") as caught:
        estimate_frf(multisine_record(1), replace(PERIODIC, local_half_width_lines=2))
    assert "`local_half_width_lines`" in caught.value.remedy
    with pytest.raises(DataError, match="neighbouring excited lines"):
        estimate_frf(multisine_record(1, spacing=60), PERIODIC)


def test_fewer_experiments_are_refused_where_blocks_are_inverted():
    with pytest.raises(DataError, match="D011") as caught:
        estimate_frf(multisine_record(1), EstimateOptions(compensation="none"))
    assert "local_periodic" in caught.value.remedy


@pytest.mark.parametrize("drift", [0.0, 5.0])
def test_coherence_is_of_what_the_response_makes_and_not_of_the_transient(drift):
    """A record that ends elsewhere than it begins has an output full of leakage, which no input explains."""
    generator, plant, noise = np.random.default_rng(4), drive(), 2e-4
    torque, angle = played(generator.standard_normal((2, 4000, 2)), plant)
    angle = angle + noise * generator.standard_normal(angle.shape) + drift * np.linspace(0, 1, 4000)[:, None]
    lines = band(4000)[::8]
    frf = estimate_frf(as_record(torque, angle, lines), LOCAL)
    response = drive_response(frf.frequency_hz, plant)
    made = (np.abs(response) ** 2).sum(axis=2) / 4000
    lost = (2 * np.pi * frf.frequency_hz[:, None]) ** 4 * noise**2 / 4000
    expected = made / (made + lost)
    assert 0.1 < 1 - expected.min() < 0.99
    error = (frf.coherence[0] - expected) / (1 - expected)
    assert abs(np.median(error)) < 0.15
