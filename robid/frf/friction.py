"""The measured response as its compensated friction changes: exact where the first order is not enough."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.frf.frf import Frf

_ROUNDING = 1e-9  # Of a coefficient's torque, what counts as none at other motors


@dataclass(frozen=True)
class FrictionMove:
    """How the response follows the friction scales: `G(s) = G (I - sum_k s_k D_k)^-1`.

    A removed torque `F` enters a block's response as `Y (U - F)^-1`, whose inverse is affine in every coefficient of
    `F`. To first order this is the response's sensitivity, but a ripple or a friction level that is some ten
    percent off moves the response of a lightly loaded motor by more than the first order holds.

    Attributes:
        response (n_conf, n_freq, n_out, n_in): Measured response as it was compensated; or lines in one axis.
        share (n_conf, n_freq, n_in, n_coef, n_in): `D_k`, torque of each coefficient per torque.
    """

    response: ComplexArray
    share: ComplexArray

    def moved(self, scales: FloatArray) -> ComplexArray:
        """Response (n_conf, n_freq, n_out, n_in) at some friction scales (n_coef,)."""
        return np.asarray(self.response @ self._gain(scales))

    def slopes(self, scales: FloatArray) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_out, n_in, n_coef) of `moved`."""
        gain = self._gain(scales)
        shape = self.response.shape[:-1]
        # All coefficients in one product of matrices per line.
        moved = self.response @ gain @ self.share.reshape(*gain.shape[:-1], -1)
        changed = moved.reshape(*shape[:-1], -1, gain.shape[-1]) @ gain
        return np.asarray(np.swapaxes(changed.reshape(*shape, scales.size, -1), -1, -2))

    def _gain(self, scales: FloatArray) -> ComplexArray:
        return np.asarray(np.linalg.inv(np.eye(self.share.shape[-1]) - scales @ self.share))


@dataclass(frozen=True)
class MotorFrictionMove:
    """The same where each coefficient is one motor's: `D_k` has that motor's row alone.

    Attributes:
        response (n_line, n_out, n_in): Measured response as it was compensated.
        motors (n_in, n_coef): Ones where a coefficient is a motor's.
        share (n_line, n_coef, n_in): The rows.
    """

    response: ComplexArray
    motors: FloatArray
    share: ComplexArray

    def moved(self, scales: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Response (n_line, n_out, n_in) at some friction scales (n_coef,), and the rows (n_line, n_coef, n_in) there.

        Its derivative by a coefficient is the column of its motor times its row.
        """
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
    share = np.linalg.pinv(frf.response)[:, None] @ frf.sensitivity
    return FrictionMove(frf.response, np.ascontiguousarray(np.moveaxis(share, 1, 3)))


def with_friction_moved(frf: Frf, scales: FloatArray) -> Frf:
    """Returns a response and its sensitivity as if the friction had been compensated `scales` (n_coef,) further on."""
    move = friction_move(frf)
    return replace(frf, response=move.moved(scales), sensitivity=np.moveaxis(move.slopes(scales), -1, 1))
