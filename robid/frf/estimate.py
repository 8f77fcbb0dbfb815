"""The estimate of a frequency response with its covariance, from the record of one configuration."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.frf.blocks import ESTIMATORS
from robid.frf.compensation import coefficient_names, disturbance, law_table, no_disturbance, record_motion
from robid.frf.covariance import element_scale, noise_covariance, total_covariance
from robid.frf.frf import CONFIGURATION_WISE, Frf
from robid.frf.options import EstimateOptions
from robid.frf.spectra import Blocks, record_blocks
from robid.signals.friction import TorqueLaw
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
        laws: Torque laws per motor to subtract, where there is compensation: the robot file's or identified ones.
        delay_s: Delay from recorded to applied torque, hold excluded [s].

    Returns:
        The response with its covariance; configuration axis kept.

    Raises:
        DataError: If an experiment block does not excite every input, or the data are not finite.

    Source:
        Wernholt and Moberg (2008), eq. 2; METHODS sec. 4.
    """
    if options.compensation == "none" or laws is None or all(law.is_zero for law in laws):
        laws = None
    measured = record_blocks(record, record.excited_lines)
    motion = None if laws is None else record_motion(record, record.excited_lines, delay_s)
    removed = no_disturbance(record) if motion is None or laws is None else disturbance(motion, laws)
    blocks = replace(measured, torque=measured.torque - removed.torque)
    _check_blocks(record, blocks)
    estimate = ESTIMATORS[options.estimator](blocks)
    response = estimate.response
    residual = blocks.acceleration - response @ blocks.torque
    total, total_freedom = total_covariance(residual, len(record.input_names), options.pooled_lines)
    scatter = blocks.acceleration_scatter - response @ blocks.torque_scatter
    noise, noise_freedom = noise_covariance(scatter, blocks.scatter_freedom, options.pooled_lines)
    per_block = blocks.acceleration @ np.linalg.inv(blocks.torque)
    names, deviation, offset = _coefficients(record, laws)
    table = ((), np.zeros(0), np.zeros(0)) if laws is None else law_table(record, laws)
    sensitivity = np.concatenate(
        [_sensitivity(response, removed.derivative, estimate.weights), _scale_sensitivity(response)]
    )
    return Frf(
        frequency_hz=record.frequency_hz,
        lines=record.excited_lines,
        configurations=record.configurations,
        response=response[None],
        input_factor=estimate.input_factor[None],
        element_scale=element_scale(per_block, estimate.input_factor, total)[None],
        total_covariance=None if total is None else total[None],
        noise_covariance=None if noise is None else noise[None],
        total_degrees_of_freedom=total_freedom,
        noise_degrees_of_freedom=noise_freedom,
        sensitivity=sensitivity[None, deviation > 0],
        coefficient_names=tuple(name for name, value in zip(names, deviation, strict=True) if value > 0),
        coefficient_relative_std=deviation[deviation > 0],
        removed_torque_rms=_rms(removed.torque)[None],
        coefficient_offset=offset[deviation > 0],
        uncompensated_response=None if laws is None else ESTIMATORS[options.estimator](measured).response[None],
        law_names=table[0],
        law_values=table[1],
        law_std=table[2],
        sampling_period_s=record.sampling_period_s,
        input_names=record.input_names,
        output_names=record.output_names,
        torque_unit=record.torque_unit,
        torque_hold=record.torque_hold,
        notes=(*record.notes, *_notes(total)),
    )


def concatenate(parts: list[Frf]) -> Frf:
    """Joins responses of single configurations along the configuration axis."""

    def joined(name: str) -> FloatArray | ComplexArray | None:
        present = [getattr(part, name) for part in parts if getattr(part, name) is not None]
        return np.concatenate(present) if present else None

    whole: dict[str, Any] = {name: joined(name) for name in CONFIGURATION_WISE}
    return replace(parts[0], **whole)


def _check_blocks(record: Record, blocks: Blocks) -> None:
    where = f"configuration at {np.array2string(np.rad2deg(record.configurations[0]), precision=1)} deg"
    n_in, n_exp = blocks.torque.shape[-2:]
    if n_exp != n_in:
        message = f"{n_exp} experiments per block cannot separate {n_in} inputs"
        raise DataError(message, where=where, remedy="record as many experiments per realization as there are motors")
    if not (np.isfinite(blocks.torque).all() and np.isfinite(blocks.acceleration).all()):
        raise DataError("the record holds NaN or infinite samples", where=where, remedy="acquire the record again")
    condition = np.linalg.cond(blocks.torque).max(axis=0)
    worst = int(np.argmax(condition))
    if condition[worst] > _CONDITION_LIMIT:
        frequency = record.frequency_hz[worst]
        message = f"the experiments do not excite every motor at {frequency:.3g} Hz (condition {condition[worst]:.1e})"
        raise DataError(message, where=where, remedy="excite all motors, or check that the lines are those played")


def _sensitivity(response: ComplexArray, derivative: ComplexArray, weights: ComplexArray) -> ComplexArray:
    """Derivative (n_coef, n_freq, n_out, n_in) of the response with respect to each motor's each coefficient."""
    moved = np.einsum("krfje,rfei->kfji", derivative, weights)
    each = np.einsum("foj,kfji->kjfoi", response, moved)
    return np.asarray(each.reshape(-1, *response.shape))


def _scale_sensitivity(response: ComplexArray) -> ComplexArray:
    """Derivative (n_in, n_freq, n_out, n_in) of the response with respect to each torque's relative error."""
    n_in = response.shape[-1]
    return np.asarray(-response * np.eye(n_in)[:, None, None, :])


def _coefficients(record: Record, laws: tuple[TorqueLaw, ...] | None) -> tuple[tuple[str, ...], FloatArray, FloatArray]:
    """Name, standard deviation and distance from the robot file's of every coefficient, the torques' scales last."""
    scale = np.zeros(record.torque.shape[-1]) if record.torque_relative_std is None else record.torque_relative_std
    names = tuple(f"{name}.torque_scale" for name in record.input_names)
    if laws is None:
        return names, scale, np.zeros_like(scale)
    deviation = np.ravel(np.transpose([law.coefficient_std for law in laws]))
    offset = np.ravel(np.transpose([law.offset for law in laws]))
    return (
        coefficient_names(record) + names,
        np.concatenate([deviation, scale]),
        np.concatenate([offset, np.zeros_like(scale)]),
    )


def _rms(torque: ComplexArray) -> FloatArray:
    """RMS of each motor over realizations and experiments (n_in,), from its complex amplitudes."""
    return np.asarray(np.sqrt(2 * (np.abs(torque) ** 2).sum(axis=1).mean(axis=(0, -1))))


def _notes(total: ComplexArray | None) -> tuple[str, ...]:
    if total is not None:
        return ()
    return ("One realization: the covariance holds noise only, no distortion by nonlinearities.",)
