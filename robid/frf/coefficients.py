"""What a fit may move of the removed torque and of the torques' scales, and what that does to a response."""

from __future__ import annotations

from typing import Any

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.frf.blocks import BlockEstimate
from robid.frf.compensation import coefficient_names, law_table
from robid.robot.friction import TorqueLaw
from robid.signals.record import Record


def _sensitivity(response: ComplexArray, derivative: ComplexArray, weights: ComplexArray) -> ComplexArray:
    """Derivative (n_coef, n_freq, n_out, n_in) of the response with respect to each motor's each coefficient."""
    moved = np.einsum("krfje,rfei->kfji", derivative, weights)
    each = np.einsum("foj,kfji->kjfoi", response, moved)
    return np.asarray(each.reshape(-1, *response.shape))


def _scale_sensitivity(response: ComplexArray) -> ComplexArray:
    """Derivative (n_in, n_freq, n_out, n_in) of the response with respect to each torque's relative error."""
    n_in = response.shape[-1]
    return np.asarray(-response * np.eye(n_in)[:, None, None, :])


def coefficients(
    record: Record, laws: tuple[TorqueLaw, ...] | None, estimate: BlockEstimate, derivative: ComplexArray
) -> dict[str, Any]:
    """Returns the fields of an `Frf` about its coefficients.

    Args:
        record: Record of a single configuration.
        laws: The removed laws, or None.
        estimate: The response.
        derivative (n_kind, n_real, n_freq, n_in, n_exp): Of the removed torque, in the order of the weights.
    """
    response = estimate.response
    scale = np.zeros(len(record.input_channels)) if record.input_relative_std is None else record.input_relative_std
    names = tuple(f"{name}.torque_scale" for name in record.input_names)
    deviation, offset = scale, np.zeros_like(scale)
    table: tuple[tuple[str, ...], FloatArray, FloatArray] = ((), np.zeros(0), np.zeros(0))
    if laws is not None:
        names = coefficient_names(record) + names
        deviation = np.concatenate([np.ravel(np.transpose([law.coefficient_std for law in laws])), deviation])
        offset = np.concatenate([np.ravel(np.transpose([law.offset for law in laws])), offset])
        table = law_table(record, laws)
    moved = _sensitivity(response, derivative, estimate.weights), _scale_sensitivity(response)
    unsure = deviation > 0
    return {
        "sensitivity": np.concatenate(moved)[None, unsure],
        "coefficient_names": tuple(name for name, chosen in zip(names, unsure, strict=True) if chosen),
        "coefficient_relative_std": deviation[unsure],
        "coefficient_offset": offset[unsure],
        "law_names": table[0],
        "law_values": table[1],
        "law_std": table[2],
    }
