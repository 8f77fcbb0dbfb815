"""What removed torque and wrong torque scales do to a response: its sensitivity, and the exact move of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.frf.blocks import BlockEstimate
from robid.frf.compensation import coefficient_names, law_table
from robid.frf.frf import Frf
from robid.robot.friction import TorqueLaw
from robid.signals.record import Record


def _sensitivity(response: ComplexArray, derivative: ComplexArray, weights: ComplexArray) -> ComplexArray:
    """Derivative (n_coef, n_freq, n_out, n_in) of the response with respect to each motor's each coefficient."""
    # dU = -dF of the removed torque changes G = Y W by G dF W: by each motor j and coefficient k.
    moved = np.einsum("krfje,rfei->kfji", derivative, weights)
    each = np.einsum("foj,kfji->kjfoi", response, moved)
    return np.asarray(each.reshape(-1, *response.shape))


def _scale_sensitivity(response: ComplexArray) -> ComplexArray:
    """Derivative (n_in, n_freq, n_out, n_in) of the response with respect to each torque's relative error."""
    # A torque that is really (1 + e) as large divides its column of G by that: dG/de = -G of this column.
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


_ROUNDING = 1e-9  # Of a coefficient's torque, what counts as none at other motors


@dataclass(frozen=True)
class FrictionMove:
    """How the response follows the friction scales: `G(s) = G (I - sum_k s_k D_k)^-1`.

    A removed torque `F` enters a block's response as `Y (U - F)^-1`, whose inverse is affine in every coefficient of
    `F`. To first order this is the response's sensitivity, but a ripple or a friction level that is some ten
    percent off moves the response of a lightly loaded motor by more than the first order holds.
    """

    response: ComplexArray  # (n_conf, n_freq, n_out, n_in) Measured response as compensated; or lines in one axis
    share: ComplexArray  # (n_conf, n_freq, n_in, n_coef, n_in) `D_k`, torque of each coefficient per torque

    def moved(self, scales: FloatArray) -> ComplexArray:
        """Response (n_conf, n_freq, n_out, n_in) at some friction scales (n_coef,)."""
        return np.asarray(self.response @ self._gain(scales))

    def slopes(self, scales: FloatArray) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_out, n_in, n_coef) of `moved`."""
        gain = self._gain(scales)
        shape = self.response.shape[:-1]
        # All coefficients in one product of matrices per line.
        # d G(s) / d s_k = G gain D_k gain, from d(A^-1) = -A^-1 dA A^-1 with A = I - sum_k s_k D_k.
        moved = self.response @ gain @ self.share.reshape(*gain.shape[:-1], -1)
        changed = moved.reshape(*shape[:-1], -1, gain.shape[-1]) @ gain
        return np.asarray(np.swapaxes(changed.reshape(*shape, scales.size, -1), -1, -2))

    def _gain(self, scales: FloatArray) -> ComplexArray:
        return np.asarray(np.linalg.inv(np.eye(self.share.shape[-1]) - scales @ self.share))


@dataclass(frozen=True)
class MotorFrictionMove:
    """The same where each coefficient is one motor's: `D_k` has that motor's row alone."""

    response: ComplexArray  # (n_line, n_out, n_in) Measured response as it was compensated
    motors: FloatArray  # (n_in, n_coef) Ones where a coefficient is a motor's
    share: ComplexArray  # (n_line, n_coef, n_in) The rows

    def moved(self, scales: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Response (n_line, n_out, n_in) at some friction scales (n_coef,), and the rows (n_line, n_coef, n_in) there.

        Its derivative by a coefficient is the column of its motor times its row.
        """
        # D_k has one row only, so that sum_k s_k D_k is a product of small matrices.
        gain = np.linalg.inv(np.eye(len(self.motors)) - (self.motors * scales) @ self.share)
        return np.asarray(self.response @ gain), np.asarray(self.share @ gain)


def motor_friction_move(move: FrictionMove) -> MotorFrictionMove | None:
    """Returns the move of a response with lines in one axis if each of its coefficients is one motor's; else None."""
    size = np.abs(move.share).max(axis=(0, 3), initial=0.0)
    own = size.argmax(axis=0)
    motors = np.zeros(size.shape)
    motors[own, np.arange(len(own))] = 1.0
    if (size * (1 - motors) > _ROUNDING * size.max(axis=0)).any():
        return None
    return MotorFrictionMove(move.response, motors, np.ascontiguousarray(move.share[:, own, np.arange(len(own))]))


def friction_move(frf: Frf) -> FrictionMove:
    """Finds the torque shares behind a response's sensitivity `S_k = G D_k`.

    Args:
        frf: Measured response; with more outputs than inputs, the shares that fit best, with fewer, the least ones.
    """
    # S_k = G D_k, solved for D_k in the least squares sense.
    share = np.linalg.pinv(frf.response)[:, None] @ frf.sensitivity
    return FrictionMove(frf.response, np.ascontiguousarray(np.moveaxis(share, 1, 3)))


def with_friction_moved(frf: Frf, scales: FloatArray) -> Frf:
    """Returns a response and its sensitivity as if the friction had been compensated `scales` (n_coef,) further on."""
    move = friction_move(frf)
    return replace(frf, response=move.moved(scales), sensitivity=np.moveaxis(move.slopes(scales), -1, 1))
