"""A linear model whose matrices are sums of basis functions of the scheduling parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, check_shape
from robid.models.lpv.fit.basis import Basis
from robid.models.lpv.fit.state_space import Sizes, StateSpace, pack, response, unpack


@dataclass(frozen=True)
class LpvModel:
    """`A(p) = A_0 + sum_k A_k psi_k(p)`, and B, C and D alike, in discrete time.

    Source:
        Turk et al. (2018), eq. 1 and 2.
    """

    parameters: FloatArray  # (n_function + 1, n_local): packed matrices of each function, the constant one first
    sizes: Sizes  # States, inputs and outputs
    basis: Basis  # the functions and the range in which they hold
    sampling_period_s: float

    @property
    def coefficients(self) -> StateSpace:
        """The matrices of each function, the constant one first."""
        return unpack(self.parameters, self.sizes)

    def at(self, points: FloatArray) -> StateSpace:
        """Returns A(p), B(p), C(p) and D(p) at points (n_point, n_scheduling).

        Raises:
            DataError: If a point lies outside the range.
        """
        return unpack(self.basis.values(points) @ self.parameters, self.sizes)

    def frozen_response(self, points: FloatArray, frequency_hz: FloatArray) -> ComplexArray:
        """Returns the response (n_point, n_freq, n_out, n_in) of the model at rest at each point.

        Raises:
            DataError: If a point lies outside the range.
        """
        return response(self.at(points), unit_circle(frequency_hz, self.sampling_period_s))


@dataclass(frozen=True)
class Stability:
    """How near the frozen models come to the unit circle."""

    radius: float  # largest absolute value of a pole over the range
    point: FloatArray  # (n_scheduling,): where it is reached

    @property
    def stable(self) -> bool:
        """Whether every frozen model on the grid is stable; a moving parameter may still excite."""
        return self.radius < 1


def unit_circle(frequency_hz: FloatArray, sampling_period_s: float) -> ComplexArray:
    """Returns `exp(j omega T)` of frequencies (n_freq,)."""
    return np.asarray(np.exp(2j * np.pi * frequency_hz * sampling_period_s))


def check_stability(model: LpvModel) -> Stability:
    """Looks for the frozen model with the largest pole on a grid over the range."""
    grid = model.basis.grid()
    radius = model.at(grid).spectral_radius
    worst = int(np.argmax(radius))
    return Stability(float(radius[worst]), grid[worst])


def simulate_lpv(
    model: LpvModel, inputs: FloatArray, scheduling: FloatArray, initial_state: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Runs a model while its scheduling parameters move.

    Args:
        model: The model.
        inputs (n_sample, n_in): Inputs.
        scheduling (n_sample, n_scheduling): Scheduling parameters of the same samples.
        initial_state (n_state,): State at the first sample; zero by default.

    Returns:
        Outputs (n_sample, n_out) and the state (n_state,) after the last sample.

    Raises:
        DataError: If the parameters leave the range.
        ValueError: If the shapes do not agree.
    """
    check_shape("inputs", inputs, "n_sample n_in", n_in=model.sizes.n_in)
    check_shape("scheduling", scheduling, "n_sample n_scheduling", n_sample=len(inputs))
    moving = model.at(scheduling)
    driven = (moving.B @ inputs[..., None])[..., 0]
    states = np.empty((len(inputs) + 1, model.sizes.n_state))
    states[0] = 0 if initial_state is None else initial_state
    for index, A in enumerate(moving.A):
        states[index + 1] = A @ states[index] + driven[index]
    outputs = np.einsum("tij,tj->ti", moving.C, states[:-1]) + np.einsum("tij,tj->ti", moving.D, inputs)
    return outputs, states[-1]


def add_integrators(model: LpvModel, integrators: tuple[int, ...]) -> LpvModel:
    """Puts integrators behind the outputs: `y(t+1) = y(t) + T v(t)`, as many as each output has.

    Behind the outputs, not before the inputs: what an output integrates stays its derivative while the scheduling
    parameter moves.
    """
    while any(integrators):
        chosen = np.array([count > 0 for count in integrators])
        model = _add_once(model, chosen)
        integrators = tuple(max(count - 1, 0) for count in integrators)
    return model


def _add_once(model: LpvModel, chosen: BoolArray) -> LpvModel:
    old, period = model.coefficients, model.sampling_period_s
    n, extra = model.sizes.n_state, int(chosen.sum())
    n_function, r, m = len(model.parameters), model.sizes.n_in, model.sizes.n_out
    A = np.zeros((n_function, n + extra, n + extra))
    A[:, :n, :n], A[:, n:, :n] = old.A, period * old.C[:, chosen]
    A[0, n:, n:] = np.eye(extra)
    B = np.concatenate([old.B, period * old.D[:, chosen]], axis=1)
    C = np.zeros((n_function, m, n + extra))
    C[:, ~chosen, :n] = old.C[:, ~chosen]
    C[0, np.flatnonzero(chosen), n + np.arange(extra)] = 1.0
    D = np.where(chosen[:, None], 0.0, old.D)
    sizes = Sizes(n + extra, r, m)
    return LpvModel(pack(StateSpace(A, B, C, D)), sizes, model.basis, period)
