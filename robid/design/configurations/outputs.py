"""Outputs that a model is to predict, by what the logarithm of its response is off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.design.configurations.options import OutputName
from robid.robot.linearize import LinearModel
from robid.robot.response import ElasticParameters, motion_matrices

_BESIDE = 1e-4  # Of a resonance's frequency, where its line lies
_APART = 0.01  # Of the distance to the next resonance, at most
_STILL = 1e-3  # Of the highest frequency: what is slower is no resonance, but gravity or rounding


def output_errors(output: OutputName, response: ComplexArray, columns: ComplexArray) -> ComplexArray:
    """Relative errors (n_freq, n_element, n_column) of an output, by columns of the log response.

    Args:
        output: `response`: its elements; `tool_displacement`: motion of the tool by each motor's torque, over its size;
            `feedforward_torque`: each motor's torque by each motor's motion, over its size for all of them.
        response (n_freq, n_out, n_in): Response; of the tool, its three axes are the outputs.
        columns (n_freq, n_out, n_in, n_column): Derivatives of its logarithm.

    Raises:
        ValueError: If the output is `resonances`, which has lines of its own.
    """
    if output == "response":
        found = columns
    elif output == "tool_displacement":
        size = np.linalg.norm(response, axis=1, keepdims=True)
        found = (response / size)[..., None] * columns
    elif output == "feedforward_torque":
        # u = G^-1 a: du = -G^-1 dG G^-1 a, with motions a of all motors that are alike and independent.
        inverse = np.linalg.inv(response)
        moved = np.einsum("fio,fomp,fmj->fijp", inverse, response[..., None] * columns, inverse, optimize=True)
        found = -moved / np.linalg.norm(inverse, axis=2)[:, :, None, None]
    else:
        raise ValueError("Argument `output` must have lines in common, but is `resonances`.")
    return np.asarray(found.reshape(len(found), -1, found.shape[-1]))


@dataclass(frozen=True)
class ResonanceLines:
    """Lines on both sides of a robot's undamped resonances in one configuration."""

    omega: FloatArray  # (n_mode,) Resonances [rad/s]
    beside: FloatArray  # (n_mode,) Relative distance of the lines from each
    motor: IntArray  # (n_mode,) The motor that takes part most

    @classmethod
    def of(
        cls, model: LinearModel, parameters: ElasticParameters, configuration: int, band_hz: FloatArray
    ) -> ResonanceLines:
        """Finds the resonances within a band (2,) [Hz]; there may be none."""
        mass, _, stiffness = motion_matrices(model, parameters, configuration)
        square, shapes = eigh(stiffness, mass)
        omega = np.sqrt(np.maximum(square, 0.0))
        low, high = 2 * np.pi * band_hz
        inside = (omega > max(low, _STILL * omega[-1])) & (omega < high)
        gaps = np.diff(omega, prepend=0.0, append=np.inf)
        beside = np.minimum(_BESIDE, _APART * np.minimum(gaps[:-1], gaps[1:]) / np.maximum(omega, 1e-300))
        # The residue of a motor's own response, beside what it has by its inertia alone.
        share = np.diagonal(mass)[: model.n_motor, None] * shapes[: model.n_motor] ** 2
        return cls(omega[inside], beside[inside], share.argmax(axis=0)[inside])

    @property
    def frequency_hz(self) -> FloatArray:
        """The lines (2 n_mode,) [Hz]: those below, then those above."""
        return np.concatenate([self.omega * (1 - self.beside), self.omega * (1 + self.beside)]) / (2 * np.pi)

    def errors(self, columns: ComplexArray) -> FloatArray:
        """Relative errors (n_mode, 1, n_column) of the resonances' frequencies.

        Near the pole of an undamped resonance the response is `R / (w_k^2 - w^2)`, so that its logarithm moves by
        `-2 w_k dw_k / (w_k^2 - w^2)`; what the rest of it moves by cancels between both sides.

        Args:
            columns (2 n_mode, n_out, n_in, n_column): Derivatives of the log response at the lines.
        """
        size = self.omega.size
        own = np.real(columns[np.arange(2 * size), np.tile(self.motor, 2), np.tile(self.motor, 2)])
        below, above = 1 - (1 - self.beside) ** 2, 1 - (1 + self.beside) ** 2
        found = -0.25 * (below[:, None] * own[:size] + above[:, None] * own[size:])
        return np.asarray(found[:, None])
