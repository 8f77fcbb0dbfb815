"""The block estimator on exact linear data, its covariance against Monte Carlo, its refusals."""

from dataclasses import replace

import numpy as np
import pytest

from robid.errors import DataError
from robid.frf.blocks import ESTIMATORS, logarithmic_mean
from robid.frf.covariance import pool
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.robot.friction import TorqueLaw
from robid.signals.quantities import motor_channels
from robid.signals.record import Record
from robid.signals.waveforms import multisine, time_signal
from tolerances import IDENTITY

PERIOD_S, N_SAMPLE = 2.0, 256
LINES = np.array([3, 7, 11, 17, 23, 31])
OMEGA = 2 * np.pi * LINES / PERIOD_S
# Output noise per sample, correlated over the outputs: its square root.
MIXING = np.array([[1.0, 0.0], [0.6, 0.8]])
# What feedback makes of an orthogonal block: torques that are not orthogonal any more.
CROSSTALK = np.array([[1.0, 0.5 + 0.4j], [-0.3j, 0.8]])
PLAIN = EstimateOptions(compensation="none", pooled_lines=1)


def true_response():
    """Two coupled masses, one with a resonance in the band."""
    s = 1j * OMEGA
    mode = s**2 / (s**2 + 2.0 * s + 40.0**2)
    rigid = np.array([[3.0, 1.0], [1.0, 2.0]])
    shape = np.array([[1.0, -2.0], [-2.0, 4.0]])
    return rigid + mode[:, None, None] * shape


def make_record(*, noise=0.0, realizations=4, periods=2, seed=0, response=None, reuse_phases=False):
    """Open-loop data with the excitation drawn by `seed` (or always the same) and white output noise [rad]."""
    generator, motors = np.random.default_rng(seed), 2
    phases = np.random.default_rng(99) if reuse_phases else generator
    amplitude = np.outer([1.0, 2.5], np.linspace(1.0, 2.0, LINES.size))
    spectrum = multisine(amplitude, phases.uniform(0, 2 * np.pi, (realizations, motors, LINES.size))) @ CROSSTALK
    acceleration = np.einsum("koi,reki->reko", true_response() if response is None else response, spectrum)
    torque = time_signal(spectrum, LINES, N_SAMPLE)
    position = time_signal(-acceleration / OMEGA[:, None] ** 2, LINES, N_SAMPLE)
    shape = (1, realizations, motors, periods, N_SAMPLE, motors)
    errors = noise * generator.standard_normal(shape) @ MIXING.T
    names = ("first", "second")
    return Record(
        sampling_period_s=PERIOD_S / N_SAMPLE,
        configurations=np.zeros((1, motors)),
        inputs=np.broadcast_to(torque[None, :, :, None], shape).copy(),
        outputs=position[None, :, :, None] + errors,
        reference=None,
        excited_lines=LINES,
        detection_lines=np.zeros(0, int),
        input_channels=motor_channels(names, "torque"),
        output_channels=motor_channels(names, "angle"),
        output_offset=np.zeros((1, motors)),
    )


def with_reference(record, mixing=((2.0, 1.0), (-1.0, 1.5))):
    """The record with a reference that the torque follows through a constant matrix."""
    return replace(
        record,
        reference=record.inputs[:, :, :, 0] @ np.array(mixing),
        reference_channels=motor_channels(record.input_names, "speed_reference"),
    )


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("realizations", [1, 3])
def test_exact_data_give_the_exact_response(estimator, realizations):
    record = with_reference(make_record(realizations=realizations))
    frf = estimate_frf(record, replace(PLAIN, estimator=estimator))
    np.testing.assert_allclose(frf.response[0], true_response(), rtol=IDENTITY * 10)
    np.testing.assert_allclose(frf.frequency_hz, LINES / PERIOD_S)
    assert (frf.total_covariance is None) == (realizations == 1)
    assert any("One realization" in note for note in frf.notes) == (realizations == 1)


def test_drift_leaves_no_trace():
    record = make_record(periods=4)
    ramp = 0.01 * np.arange(4 * N_SAMPLE).reshape(4, N_SAMPLE, 1) / N_SAMPLE
    frf = estimate_frf(replace(record, outputs=record.outputs + ramp), PLAIN)
    np.testing.assert_allclose(frf.response[0], true_response(), rtol=1e-9)


def vec(response):
    """Columns stacked, per line."""
    return np.swapaxes(response, -1, -2).reshape(*response.shape[:-2], -1)


@pytest.mark.parametrize(("realizations", "periods"), [(4, 2), (1, 4)])
def test_covariance_against_monte_carlo(realizations, periods):
    runs, found, claimed = 400, [], []
    for seed in range(runs):
        record = make_record(noise=1e-4, realizations=realizations, periods=periods, seed=seed, reuse_phases=True)
        frf = estimate_frf(record, replace(PLAIN, estimator="arithmetic"))
        found.append(vec(frf.response[0]))
        claimed.append(frf.full_covariance(0))
    error = np.array(found) - vec(true_response())
    empirical = np.einsum("rka,rkb->kab", error, error.conj()) / runs
    claimed = np.mean(claimed, axis=0)
    for line in range(LINES.size):
        distance = np.linalg.norm(empirical[line] - claimed[line]) / np.linalg.norm(claimed[line])
        # An entry of a sample covariance deviates by 1/sqrt(runs); four by four entries add up.
        assert distance < 4 / np.sqrt(runs), (line, distance)
    ratio = np.diagonal(empirical, axis1=1, axis2=2).real / np.diagonal(claimed, axis1=1, axis2=2).real
    np.testing.assert_allclose(ratio.mean(), 1.0, atol=4 / np.sqrt(runs * ratio.size))
    np.testing.assert_allclose(frf.element_variance()[0, 2, 1, 0], frf.full_covariance(0)[2, 1, 1].real, rtol=1e-12)


@pytest.mark.parametrize(
    ("pooled", "realizations", "periods"),
    [(3, 4, 1), (1, 1, 4), *(pytest.param(*each, marks=pytest.mark.slow) for each in ((1, 4, 1), (3, 1, 4)))],
)
def test_degrees_of_freedom_are_those_of_the_scatter(realizations, periods, pooled):
    draws = []
    for seed in range(500):
        record = make_record(noise=1e-4, realizations=realizations, periods=periods, seed=seed)
        frf = estimate_frf(record, replace(PLAIN, pooled_lines=pooled))
        freedom = frf.total_degrees_of_freedom if realizations > 1 else frf.noise_degrees_of_freedom
        draws.append(frf.covariance[0, 2, 0, 0].real)
    relative = np.var(draws) / np.mean(draws) ** 2
    # Over realizations, noise grows over the pooled lines with the fourth power of frequency, which lowers their
    # number; periods tell it of lines beside each one.
    weight = OMEGA[2 - pooled // 2 : 3 + pooled // 2] ** 4
    effective = weight.sum() ** 2 / (weight**2).sum() / weight.size if realizations > 1 else 1.0
    np.testing.assert_allclose(1 / relative, freedom * effective, rtol=0.3)


def test_more_realizations_and_periods_reduce_noise_as_they_should():
    def spread(realizations, periods):
        frf = estimate_frf(make_record(noise=1e-4, realizations=realizations, periods=periods, seed=3), PLAIN)
        return frf.element_variance().mean()

    few = spread(2, 2)
    np.testing.assert_allclose(spread(16, 2), few / 8, rtol=0.5)
    np.testing.assert_allclose(spread(2, 16), few / 8, rtol=0.5)


def test_full_covariance_is_the_scaled_kronecker_product():
    frf = estimate_frf(make_record(noise=1e-4), PLAIN)
    full = frf.full_covariance(0)
    root = np.sqrt(vec(frf.element_scale[0][None])[0])
    wanted = np.kron(frf.input_factor[0, 2], frf.covariance[0, 2]) * np.outer(root, root)
    np.testing.assert_allclose(full[2], wanted, rtol=IDENTITY)
    diagonal = np.diagonal(full, axis1=1, axis2=2).real
    np.testing.assert_allclose(diagonal, vec(frf.element_variance()[0]), rtol=IDENTITY)


@pytest.mark.parametrize("estimator", ["arithmetic", "logarithmic"])
def test_realization_errors_are_each_realizations_share(estimator):
    options = replace(PLAIN, estimator=estimator)
    record = make_record(noise=1e-5, realizations=4)
    frf = estimate_frf(record, options)
    errors = frf.realization_error[0]
    each = [record.realizations(1, index) for index in range(4)]
    single = np.stack([estimate_frf(one, options).response[0] for one in each])
    np.testing.assert_allclose(errors, (single - frf.response[0]) / 4, atol=1e-3 * np.abs(errors).max())
    assert np.abs(errors.sum(axis=0)).max() < 1e-2 * np.abs(errors).max()
    # Their squares are the variance, over all lines on average.
    scatter = (np.abs(errors) ** 2).sum(axis=0) * 4 / 3 / frf.element_variance()[0]
    np.testing.assert_allclose(scatter.mean(axis=0), 1.0, rtol=1e-6)


def test_one_realization_has_no_error_of_its_own():
    assert estimate_frf(make_record(noise=1e-4, realizations=1), PLAIN).realization_error is None


def complex_normal(generator, *shape):
    return (generator.standard_normal(shape) + 1j * generator.standard_normal(shape)) / np.sqrt(2)


def test_error_radius_covers_as_often_as_it_says():
    # Phases of each block its own, few degrees of freedom: (4 - 1) x 2.
    outside, runs = [], 300
    for seed in range(runs):
        frf = estimate_frf(make_record(noise=1e-4, seed=seed), replace(PLAIN, estimator="arithmetic"))
        outside.append(np.abs(frf.response[0] - true_response()) > frf.error_radius(0.95)[0])
    # A normal radius would be left by 9 % of the errors.
    np.testing.assert_allclose(np.mean(outside), 0.05, atol=0.012)


def test_logarithm_takes_its_branch_from_the_mean():
    blocks = np.array([np.exp(1j * (np.pi - 0.1)), np.exp(1j * (np.pi + 0.1)) * 1.21])
    np.testing.assert_allclose(logarithmic_mean(blocks[:, None])[0], -1.1, rtol=1e-12)


def test_pooling_is_a_mean_over_neighbours():
    covariance = np.arange(5.0).reshape(5, 1, 1) ** 2
    np.testing.assert_allclose(pool(covariance, 3)[:, 0, 0], [0.5, 5 / 3, 14 / 3, 29 / 3, 12.5])
    np.testing.assert_allclose(pool(covariance, 1), covariance)


def test_block_that_does_not_excite_every_motor_is_refused():
    record = make_record()
    torque = record.inputs.copy()
    torque[..., 1] = 2 * torque[..., 0]
    with pytest.raises(DataError, match=r"do not excite every motor at .* Hz"):
        estimate_frf(replace(record, inputs=torque), PLAIN)


def test_missing_experiment_is_refused():
    record = make_record()
    with pytest.raises(DataError, match="1 experiments per block cannot separate 2 inputs"):
        estimate_frf(replace(record, inputs=record.inputs[:, :, :1], outputs=record.outputs[:, :, :1]), PLAIN)


@pytest.mark.parametrize("estimator", ["joint", "indirect"])
def test_instrument_that_is_missing_or_excites_too_little_is_refused(estimator):
    options = replace(PLAIN, estimator=estimator)
    with pytest.raises(DataError, match=rf"`{estimator}` needs the reference.*\n.*`logarithmic`"):
        estimate_frf(make_record(), options)
    with pytest.raises(DataError, match=rf"`{estimator}`: the reference does not excite every motor at .* Hz"):
        estimate_frf(with_reference(make_record(), ((1.0, 2.0), (1.0, 2.0))), options)
    with pytest.raises(DataError, match=rf"`{estimator}`: the reference does not excite every motor at .* Hz"):
        estimate_frf(with_reference(make_record(), np.zeros((2, 2))), options)


def part_of(record, realizations=slice(None), experiments=slice(None)):
    fields = {name: getattr(record, name)[:, realizations, experiments] for name in ("inputs", "outputs", "reference")}
    return replace(record, **fields)


@pytest.mark.parametrize("estimator", ["joint", "h1"])
def test_blocks_of_fewer_experiments_serve_together(estimator):
    options = replace(PLAIN, estimator=estimator)
    part = part_of(with_reference(make_record()), experiments=slice(1))
    np.testing.assert_allclose(estimate_frf(part, options).response[0], true_response(), rtol=1e-8)
    with pytest.raises(DataError, match="1 experiments per block cannot separate 2 inputs"):
        estimate_frf(part_of(part, realizations=slice(1)), options)


def test_joint_weighs_by_the_references_power_and_indirect_does_not():
    record = make_record(realizations=2, noise=1e-3)
    gain = np.array([1.0, 30.0])[:, None, None, None, None]
    # The second realization is louder and its noise with it.
    record = with_reference(replace(record, inputs=record.inputs * gain, outputs=record.outputs * gain))

    def response(part, estimator):
        return estimate_frf(part, replace(PLAIN, estimator=estimator)).response[0]

    quiet, loud = (response(part_of(record, slice(k, k + 1)), "joint") for k in range(2))
    np.testing.assert_allclose(response(record, "joint"), loud, atol=0.05 * np.abs(quiet - loud).max())
    assert np.abs(response(record, "indirect") - loud).max() > 0.2 * np.abs(quiet - loud).max()


@pytest.mark.parametrize("channel", ["inputs", "outputs"])
def test_nan_is_refused(channel):
    record = make_record()
    samples = getattr(record, channel).copy()
    samples[0, 0, 0, 0, 5, 0] = np.nan
    with pytest.raises(DataError, match="NaN"):
        estimate_frf(replace(record, **{channel: samples}), PLAIN)


LAWS = (TorqueLaw(0.4, 0.5, 3.0, 0.02, 0.1, 0.05, 2), TorqueLaw(0.3, 0.3, 3.0, 0.02, 0.1, 0.0, 2))


def test_compensation_takes_the_nominal_friction_out():
    record = make_record()
    delay_s = 0.4 * record.sampling_period_s
    compensated = estimate_frf(record, EstimateOptions(), LAWS, delay_s)
    nothing = tuple(replace(law, coulomb_nm=0.0, static_nm=0.0, ripple_nm=0.0) for law in LAWS)
    plain = estimate_frf(record, EstimateOptions(), nothing, delay_s)
    np.testing.assert_allclose(plain.response[0], true_response(), rtol=1e-9)
    assert plain.coefficient_names == ()
    assert (np.abs(compensated.response / plain.response - 1).max(axis=(0, 1)) > 0.01).all()
    assert (compensated.removed_torque_rms > 0.1).all()
    assert "first.level" in compensated.coefficient_names
    assert not any(name.startswith("second.ripple") for name in compensated.coefficient_names)


@pytest.mark.parametrize("name", ["first.level", "second.level", "first.shape", "second.shape"])
@pytest.mark.parametrize("estimator", ["arithmetic", "joint"])
def test_sensitivity_is_the_derivative(name, estimator):
    record = with_reference(make_record(realizations=2))
    motor, kind = ("first", "second").index(name.partition(".")[0]), name.partition(".")[2]
    fields = ("coulomb_nm", "static_nm") if kind == "level" else ("stribeck_rad_s", "width")

    def moved(relative):
        law = LAWS[motor]
        changed = replace(law, **{field: getattr(law, field) * (1 + relative) for field in fields})
        laws = tuple(changed if index == motor else law for index, law in enumerate(LAWS))
        return estimate_frf(record, EstimateOptions(estimator=estimator), laws)

    step = 1e-4 if kind == "level" else 0.05
    here = moved(0.0)
    behind = moved(-step).response if kind == "level" else here.response
    slope = (moved(step).response - behind)[0] / (2 * step if kind == "level" else step)
    found = here.sensitivity[0, here.coefficient_names.index(name)]
    # The derivative is of the arithmetic mean in the torque; both blocks share it to the size of friction squared.
    assert np.abs(found - slope).max() < 0.02 * np.abs(slope).max()
