"""Exact discretisation of a held input's way through a cascade of poles, and its simulation.

A cascade has one real state per pole. Its first states, those of the poles, span all numerators over `a(s)`, and all
states, those of the poles twice, all numerators over `a(s)^2`: what an output and its derivatives are made of.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import expm, solve_triangular
from scipy.signal import lfilter

from robid.arrays import ComplexArray, FloatArray

Hold = Literal["zoh", "foh"]
Start = Literal["rest", "periodic", "free"]

_SAME_POLE = 1e-7  # of the magnitude, an imaginary part that counts as none
_STANDING = 1e-9  # of one, what a pole's mode must change by in a period to have a steady state


@dataclass(frozen=True)
class Stage:
    """One real pole or one complex pair."""

    pole: complex  # the pole, that with positive imaginary part of a pair, over the reference frequency
    first: int  # index of its first state
    is_pair: bool  # whether it has two states

    @property
    def states(self) -> slice:
        """Its states."""
        return slice(self.first, self.first + 1 + self.is_pair)

    @property
    def factor(self) -> FloatArray:
        """Its polynomial, highest power first."""
        if self.is_pair:
            return np.array([1.0, -2 * self.pole.real, abs(self.pole) ** 2])
        return np.array([1.0, -self.pole.real])

    @property
    def gain(self) -> float:
        """Gain that keeps its states as large as what drives it."""
        return max(abs(self.pole), 1.0)


@dataclass(frozen=True)
class Cascade:
    """Poles one after the other, in time and frequency over those of a reference frequency."""

    stages: tuple[Stage, ...]  # the stages, fast ones first
    A: FloatArray  # (n_state, n_state): continuous-time system matrix, lower block triangular
    b: FloatArray  # (n_state,): its input vector
    numerators: FloatArray  # (n_state, n_state): polynomial of each state over that of all poles, highest power first

    def expand(self, polynomials: FloatArray) -> FloatArray:
        """Expands polynomials (..., n_power) over that of all poles in the states: coefficients (..., n_state)."""
        size = len(self.b)
        padded = np.zeros((*polynomials.shape[:-1], size))
        padded[..., size - polynomials.shape[-1] :] = polynomials
        flat = padded.reshape(-1, size).T
        return np.asarray(solve_triangular(self.numerators, flat, trans="T").T.reshape(padded.shape))


def find_stages(denominator: FloatArray) -> tuple[Stage, ...]:
    """Returns the poles of a polynomial (n_pole + 1,), highest power first, as stages from fast to slow."""
    roots = np.roots(denominator)
    pairs = roots[roots.imag > _SAME_POLE * np.abs(roots)]
    # A pair that all but meets on the axis becomes one pole twice.
    single = roots[np.abs(roots.imag) <= _SAME_POLE * np.abs(roots)].real
    poles = sorted([*pairs.tolist(), *single.astype(complex).tolist()], key=lambda pole: (-abs(pole), -pole.real))
    return chain_stages(poles)


def chain_stages(poles: list[complex]) -> tuple[Stage, ...]:
    """Strings poles together; a complex one stands for its pair."""
    stages: list[Stage] = []
    first = 0
    for pole in poles:
        stages.append(Stage(pole, first, pole.imag != 0))
        first += 1 + (pole.imag != 0)
    return tuple(stages)


def build_cascade(stages: tuple[Stage, ...], copies: int = 1) -> Cascade:
    """Builds the cascade of some poles, or of each twice, the second time in reverse.

    Args:
        stages: The poles.
        copies: 1 for `a(s)`, 2 for `a(s)^2`.
    """
    poles = [stage.pole for stage in stages]
    stages = chain_stages([*poles, *reversed(poles)] if copies == 2 else poles)
    size = stages[-1].states.stop
    A, b = np.zeros((size, size)), np.zeros(size)
    for index, stage in enumerate(stages):
        row, gain, pole = stage.first, stage.gain, stage.pole
        A[row, row] = pole.real
        if stage.is_pair:
            A[row : row + 2, row : row + 2] = [[pole.real, -(pole.imag**2) / gain], [gain, pole.real]]
        if index:
            A[row, row - 1] = gain
        else:
            b[row] = gain
    return Cascade(stages, A, b, _numerators(stages))


def _numerators(stages: tuple[Stage, ...]) -> FloatArray:
    size = stages[-1].states.stop
    rows = np.zeros((size, size))
    gains = np.cumprod([stage.gain ** (1 + stage.is_pair) for stage in stages])
    later = np.ones(1)
    for stage, gain in zip(reversed(stages), reversed(gains.tolist()), strict=True):
        if stage.is_pair:
            rows[stage.first + 1, size - len(later) :] = gain * later
            above = np.convolve([1.0, -stage.pole.real], later) * gain / stage.gain
            rows[stage.first, size - len(above) :] = above
        else:
            rows[stage.first, size - len(later) :] = gain * later
        later = np.convolve(stage.factor, later)
    return rows


@dataclass(frozen=True)
class Held:
    """A cascade discretised for one hold: `x+ = A x + now u + slope (u+ - u)`."""

    cascade: Cascade
    A: FloatArray  # (n_state, n_state): transition over one sample
    now: FloatArray  # (n_state,): what the input at a sample adds
    slope: FloatArray  # (n_state,): what the input's change until the next sample adds; zero for a zero-order hold


def discretise(cascade: Cascade, period: float, hold: Hold) -> Held:
    """Discretises a cascade exactly by one matrix exponential.

    Args:
        cascade: The cascade.
        period: Sampling period times the reference frequency.
        hold: What the input does between samples.

    Source:
        Van Loan (1978), "Computing integrals involving the matrix exponential".
    """
    size = len(cascade.b)
    augmented = np.zeros((size + 2, size + 2))
    augmented[:size, :size] = cascade.A * period
    augmented[:size, size] = cascade.b * period
    augmented[size, size + 1] = 1.0
    flow = expm(augmented)
    slope = flow[:size, size + 1] if hold == "foh" else np.zeros(size)
    return Held(cascade, flow[:size, :size], flow[:size, size], slope)


def propagate(held: Held, period: float, inputs: FloatArray, start: Start) -> FloatArray:
    """Simulates a cascade's states for several inputs.

    Args:
        held: The discretised cascade.
        period: Sampling period times the reference frequency.
        inputs (n_in, n_sample): The inputs.
        start: `periodic` for the steady state of a period, else from zero.

    Returns:
        States (n_in, n_state, n_sample).
    """
    periodic = start == "periodic"
    change = np.diff(inputs, axis=-1, append=inputs[:, :1] if periodic else inputs[:, -1:])
    driven = held.now[:, None] * inputs[:, None, :]
    if held.slope.any():
        driven += held.slope[:, None] * change[:, None, :]
    return _substitute(held, period, driven, np.zeros(len(held.now)), periodic=periodic)


def release(held: Held, period: float, n_sample: int) -> FloatArray:
    """Returns the states (n_state, n_sample) after an impulse at the first sample, which make all free responses."""
    driven = np.zeros((1, len(held.now), n_sample))
    return np.asarray(_substitute(held, period, driven, held.cascade.b, periodic=False)[0])


def _substitute(held: Held, period: float, driven: FloatArray, initial: FloatArray, *, periodic: bool) -> FloatArray:
    """Solves the recursion (n_in, n_state, n_sample) stage by stage; `driven` becomes the states."""
    states = driven
    for stage in held.cascade.stages:
        place, before = stage.states, slice(0, stage.first)
        force = driven[:, place]
        if stage.first:
            force = force + np.matmul(held.A[place, before], states[:, before])
        mode = np.exp(stage.pole * period)
        if stage.is_pair:
            squeeze = stage.pole.imag / stage.gain
            first = complex(initial[stage.first], squeeze * initial[stage.first + 1])
            found = _recur(mode, force[:, 0] + 1j * squeeze * force[:, 1], first, periodic=periodic)
            states[:, stage.first] = found.real
            np.divide(found.imag, squeeze, out=states[:, stage.first + 1])
        else:
            found = _recur(mode.real, force[:, 0], float(initial[stage.first]), periodic=periodic)
            states[:, stage.first] = found
    return states


def _recur(
    mode: complex | float, force: FloatArray | ComplexArray, first: complex | float, *, periodic: bool
) -> FloatArray | ComplexArray:
    """Solves `x+ = mode x + force` (n_in, n_sample) from a first value, or with the last followed by the first."""
    ahead, behind = [1.0], [1.0, -mode]
    standing = periodic and abs(1 - mode ** force.shape[-1]) <= _STANDING
    if standing and np.isrealobj(force):
        # Levels of an integrator and of what drives it are free: the offset estimated along holds them.
        force = force - force.mean(axis=-1, keepdims=True)
    found = np.empty(force.shape, dtype=np.result_type(force, np.asarray(mode)))
    found[:, 0] = first
    if periodic:
        returned = lfilter(ahead, behind, force, axis=-1)[:, -1]
        found[:, 0] = 0.0 if standing else returned / (1 - mode ** force.shape[-1])
    memory = mode * found[:, :1]
    found[:, 1:], _ = lfilter(ahead, behind, force[:, :-1], axis=-1, zi=memory)
    return found
