"""Block estimators of the frequency response with structured covariance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.frf.options import EstimateOptions
from robid.frf.spectra import Spectra, record_spectra
from robid.signals.friction import KINDS, TorqueLaw
from robid.signals.record import Record

_CONDITION_LIMIT = 1e6


def estimate_frf(
    record: Record,
    options: EstimateOptions,
    laws: tuple[TorqueLaw, ...] | None = None,
    delay_s: float = 0.0,
) -> Frf:
    """Estimates the frequency response of one configuration.

    Args:
        record: Record of a single configuration.
        options: Estimator, compensation and pooling.
        laws: Torque nonlinearities per motor, for `compensation: nominal`.
        delay_s: Delay from recorded to applied torque, hold excluded [s].

    Returns:
        The response with its covariance; configuration axis kept.

    Raises:
        DataError: If an experiment block does not excite every input, or the data are not finite.

    Source:
        Wernholt and Moberg (2008), eq. 2; METHODS sec. 4.
    """
    compensate = options.compensation == "nominal" and laws is not None and not all(law.is_zero for law in laws)
    spectra = record_spectra(record, laws if compensate else None, delay_s)
    torque = _blocks(spectra.torque - spectra.nominal)
    acceleration = _blocks(spectra.acceleration)
    _check_blocks(record, torque, acceleration)
    inverse = np.linalg.inv(torque.mean(axis=1))
    per_block = acceleration.mean(axis=1) @ inverse
    response = average(per_block, options.estimator)
    residual = acceleration - response @ torque
    total, total_freedom = _total_covariance(residual.mean(axis=1), options.pooled_lines)
    noise, noise_freedom = _noise_covariance(residual, options.pooled_lines)
    factor = np.einsum("rfei,rfej->fij", inverse, inverse.conj()) / per_block.shape[0] ** 2
    names, deviation = _coefficients(record, laws if compensate else None)
    sensitivity = np.concatenate([_sensitivity(response, spectra, inverse), _scale_sensitivity(response)])
    return Frf(
        frequency_hz=record.frequency_hz,
        lines=record.excited_lines,
        configurations=record.configurations,
        response=response[None],
        input_factor=factor[None],
        element_scale=_element_scale(per_block, factor, total)[None],
        total_covariance=None if total is None else total[None],
        noise_covariance=None if noise is None else noise[None],
        total_degrees_of_freedom=total_freedom,
        noise_degrees_of_freedom=noise_freedom,
        sensitivity=sensitivity[None, deviation > 0],
        coefficient_names=tuple(name for name, value in zip(names, deviation, strict=True) if value > 0),
        coefficient_relative_std=deviation[deviation > 0],
        removed_torque_rms=_removed(spectra, record)[None],
        sampling_period_s=record.sampling_period_s,
        input_names=record.input_names,
        output_names=record.output_names,
        torque_unit=record.torque_unit,
        torque_hold=record.torque_hold,
        notes=(*record.notes, *_notes(total)),
    )


def average(per_block: ComplexArray, estimator: str) -> ComplexArray:
    """Averages block responses (n_real, ...) arithmetically or by their logarithm.

    The logarithm's branch is taken relative to the arithmetic mean (METHODS sec. 4).
    """
    mean = per_block.mean(axis=0)
    if estimator == "arithmetic":
        return np.asarray(mean)
    return np.asarray(mean * np.exp(np.log(per_block / mean).mean(axis=0)))


def concatenate(parts: list[Frf]) -> Frf:
    """Joins responses of single configurations along the configuration axis."""
    first = parts[0]
    total = [part.total_covariance for part in parts if part.total_covariance is not None]
    noise = [part.noise_covariance for part in parts if part.noise_covariance is not None]
    return replace(
        first,
        configurations=np.concatenate([part.configurations for part in parts]),
        response=np.concatenate([part.response for part in parts]),
        input_factor=np.concatenate([part.input_factor for part in parts]),
        element_scale=np.concatenate([part.element_scale for part in parts]),
        total_covariance=np.concatenate(total) if total else None,
        noise_covariance=np.concatenate(noise) if noise else None,
        sensitivity=np.concatenate([part.sensitivity for part in parts]),
        removed_torque_rms=np.concatenate([part.removed_torque_rms for part in parts]),
    )


def _blocks(spectrum: ComplexArray) -> ComplexArray:
    """Reorders (real, exp, period, freq, channel) to (real, period, freq, channel, exp)."""
    return np.asarray(spectrum.transpose(0, 2, 3, 4, 1))


def _check_blocks(record: Record, torque: ComplexArray, acceleration: ComplexArray) -> None:
    where = f"configuration at {np.array2string(np.rad2deg(record.configurations[0]), precision=1)} deg"
    n_in, n_exp = torque.shape[-2:]
    if n_exp != n_in:
        message = f"{n_exp} experiments per block cannot separate {n_in} inputs"
        raise DataError(message, where=where, remedy="record as many experiments per realization as there are motors")
    if not (np.isfinite(torque).all() and np.isfinite(acceleration).all()):
        raise DataError("the record holds NaN or infinite samples", where=where, remedy="acquire the record again")
    condition = np.linalg.cond(torque.mean(axis=1)).max(axis=0)
    worst = int(np.argmax(condition))
    if condition[worst] > _CONDITION_LIMIT:
        frequency = record.frequency_hz[worst]
        message = f"the experiments do not excite every motor at {frequency:.3g} Hz (condition {condition[worst]:.1e})"
        raise DataError(message, where=where, remedy="excite all motors, or check that the lines are those played")


def _total_covariance(residual: ComplexArray, pooled: int) -> tuple[ComplexArray | None, float]:
    n_real, n_freq, _, n_exp = residual.shape
    if n_real < 2:
        return None, 0.0
    covariance = np.einsum("rfoe,rfpe->fop", residual, residual.conj()) / (n_exp * (n_real - 1))
    return pool(covariance, pooled), float(n_exp * (n_real - 1) * min(pooled, n_freq))


def _element_scale(per_block: ComplexArray, factor: ComplexArray, total: ComplexArray | None) -> FloatArray:
    """Sample variance of each element's mean over that of the Kronecker product (n_out, n_in), mean over lines."""
    n_real = per_block.shape[0]
    if total is None:
        return np.ones(per_block.shape[2:])
    sample = per_block.var(axis=0) / (n_real - 1)
    rows = np.real(np.diagonal(total, axis1=-2, axis2=-1))
    columns = np.real(np.diagonal(factor, axis1=-2, axis2=-1))
    product = rows[:, :, None] * columns[:, None, :]
    ratio = np.divide(sample, product, out=np.ones_like(product), where=product > 0)
    return np.asarray(ratio.mean(axis=0))


def _noise_covariance(residual: ComplexArray, pooled: int) -> tuple[ComplexArray | None, float]:
    n_real, n_period, n_freq, _, n_exp = residual.shape
    if n_period < 2:
        return None, 0.0
    deviation = residual - residual.mean(axis=1, keepdims=True)
    freedom = n_exp * n_real * (n_period - 1)
    covariance = np.einsum("rafoe,rafpe->fop", deviation, deviation.conj()) / (freedom * n_period)
    return pool(covariance, pooled), float(freedom * min(pooled, n_freq))


def pool(covariance: ComplexArray, count: int) -> ComplexArray:
    """Averages covariances (n_freq, n, n) over `count` neighbouring lines, fewer at the edges."""
    half = count // 2
    n_freq = covariance.shape[0]
    return np.array([covariance[max(0, k - half) : min(n_freq, k + half + 1)].mean(axis=0) for k in range(n_freq)])


def _sensitivity(response: ComplexArray, spectra: Spectra, inverse: ComplexArray) -> ComplexArray:
    """Derivative (n_coef, n_freq, n_out, n_in) of `Y (U - s F)^-1` with respect to each coefficient s."""
    moved = [
        np.einsum("rfje,rfei->rfji", _blocks(kind).mean(axis=1), inverse).mean(axis=0) for kind in spectra.disturbance
    ]
    if not moved:
        return np.zeros((0, *response.shape), complex)
    each = np.einsum("foj,kfji->kjfoi", response, np.array(moved))
    return np.asarray(each.reshape(-1, *response.shape))


def _scale_sensitivity(response: ComplexArray) -> ComplexArray:
    """Derivative (n_in, n_freq, n_out, n_in) of the response with respect to each torque's relative error."""
    n_in = response.shape[-1]
    return np.asarray(-response * np.eye(n_in)[:, None, None, :])


def _coefficients(record: Record, laws: tuple[TorqueLaw, ...] | None) -> tuple[tuple[str, ...], FloatArray]:
    scale = np.zeros(record.torque.shape[-1]) if record.torque_relative_std is None else record.torque_relative_std
    names = tuple(f"{name}.torque_scale" for name in record.input_names)
    if laws is None:
        return names, scale
    coefficients = tuple(f"{name}.{kind}" for kind in KINDS for name in record.input_names)
    return coefficients + names, np.concatenate([np.array([law.coefficient_std for law in laws]).T.ravel(), scale])


def _removed(spectra: Spectra, record: Record) -> FloatArray:
    power = 2 * (np.abs(spectra.nominal) ** 2).sum(axis=3).mean(axis=(0, 1, 2))
    return np.asarray(np.sqrt(power)).reshape(record.torque.shape[-1])


def _notes(total: ComplexArray | None) -> tuple[str, ...]:
    if total is not None:
        return ()
    return ("One realization: the covariance holds noise only, no distortion by nonlinearities.",)
