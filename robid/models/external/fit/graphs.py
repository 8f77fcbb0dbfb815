"""What a page draws of transfer functions: responses with deviations, step responses, root loci."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.external.fit.parameters import Root, poles_of, zeros_of
from robid.models.external.fit.solution import Responses, RootLoci, StepResponses
from robid.models.external.fit.transfer import Cascade, TransferMatrix, build_cascade, delayed, discretise, propagate


@dataclass(frozen=True)
class ResponseDeviation:
    """Standard deviations of a response (n_freq, n_out, n_in)."""

    magnitude: FloatArray  # of the magnitude over itself
    phase_rad: FloatArray

    @property
    def largest(self) -> FloatArray:
        """Deviation (n_freq, n_out, n_in) of the complex response over its magnitude."""
        return np.hypot(self.magnitude, self.phase_rad)


def response_deviation(
    model: TransferMatrix, root: FloatArray, omega: FloatArray, *, sampled: bool = False
) -> ResponseDeviation:
    """Propagates the coefficients' covariance to the response.

    The continuous response of a model with poles beyond the sampling is often not determined where that from samples to
    samples is. `root` (n_param, n_root) is one of the covariance of `[numerators, denominator]` without the latter's
    first, `omega` (n_freq,) in rad/s; `sampled` is from samples to samples, with hold and average.
    """
    omega = np.asarray(omega, dtype=float)
    cascade, weights, scale = _derivatives(model, root)
    if sampled:
        held = discretise(cascade, model.sampling_period_s * scale, model.hold)
        z = np.exp(1j * omega * model.sampling_period_s)
        # From x+ = A x + now u + slope (u+ - u): X(z) = (z - A)^-1 (now + slope (z - 1)) U(z).
        drive = held.now + held.slope * (z[:, None] - 1)
        states = np.linalg.solve(z[:, None, None] * np.eye(len(held.now)) - held.A, drive[..., None])[..., 0]
        powers = z[:, None] ** -(model.delay_samples + np.arange(model.moving_average))
        states = states * powers.mean(axis=1)[:, None]
        whole = model.sampled_response(omega)
    else:
        s = 1j * omega / scale
        states = np.linalg.solve(s[:, None, None] * np.eye(len(cascade.b)) - cascade.A, cascade.b[:, None])[..., 0]
        states = states * np.exp(-1j * omega * model.delay_samples * model.sampling_period_s)[:, None]
        whole = model.response(omega)
    with np.errstate(divide="ignore", invalid="ignore"):
        # To first order ln G moves by dG / G: its real part is the relative change of the magnitude, its imaginary part
        # that of the phase.
        relative = np.einsum("fk,oikr->foir", states, weights) / whole[..., None]
    return ResponseDeviation(np.linalg.norm(relative.real, axis=-1), np.linalg.norm(relative.imag, axis=-1))


def output_deviation(
    model: TransferMatrix, root: FloatArray, inputs: FloatArray, start: Literal["rest", "periodic"] = "rest"
) -> FloatArray:
    """Propagates the coefficients' covariance to a simulation.

    Returns the deviation (n_sample, n_out) of each output for commands (n_sample, n_in), from zero state or in the
    steady state of a period; `root` is as in `response_deviation`.
    """
    cascade, weights, scale = _derivatives(model, root)
    period = model.sampling_period_s * scale
    commands = delayed(inputs, model.delay_samples, model.moving_average, start)
    states = propagate(discretise(cascade, period, model.hold), period, commands, start)
    moves = np.einsum("ikt,oikr->tor", states, weights, optimize=True)
    return np.asarray(np.linalg.norm(moves, axis=-1))


def _derivatives(model: TransferMatrix, root: FloatArray) -> tuple[Cascade, FloatArray, float]:
    """Returns what a covariance root's columns move outputs by.

    They are the cascade of the poles, each twice, the weights (n_out, n_in, n_state, n_root) of its states in those
    moves, and the reference frequency [rad/s].
    """
    single, _, scale = model.cascade()
    n_pole, (n_out, n_in, n_weight) = len(single.b), model.numerator.shape
    cascade = build_cascade(single.stages, 2)
    if root.shape[1] > root.shape[0]:
        # Any root R with the same R R^T does: the triangular one has no more columns than there are coefficients.
        root = np.linalg.qr(root.T)[1].T
    above = scale ** (np.arange(n_weight - 1, -1.0, -1.0) - n_pole)
    below = scale ** -np.arange(n_pole + 1.0)
    denominator = model.denominator * below
    pole_moves = root[-n_pole:] * below[1:, None]
    weights = np.zeros((n_out, n_in, 2 * n_pole, root.shape[1]))
    zero_moves = root[:-n_pole].reshape(n_out, n_in, n_weight, -1) * above[:, None]
    for output, input_ in np.ndindex(n_out, n_in):
        numerator = model.numerator[output, input_] * above
        polynomials = np.zeros((root.shape[1], 2 * n_pole))
        for row, up, down in zip(polynomials, zero_moves[output, input_].T, pole_moves.T, strict=True):
            # d(B/A) = (dB A - B dA) / A^2: a polynomial over the poles twice, expanded in the states of the double
            # cascade.
            for product in (np.convolve(up, denominator), -np.convolve(down, numerator)):
                row[len(row) - len(product) :] += product
        weights[output, input_] = cascade.expand(polynomials).T
    return cascade, weights, scale


_TIMES, _GAINS, _FREQUENCIES = 400, 160, 200
_RISE = (0.1, 0.9)
_TURNS = 25.0
_RINGS_FOR = 12.0  # time constants until the end
_SETTLED = 0.02
_TIME_CONSTANTS = 7.0
_MARGIN = 1.25
_NUDGE = 1e-6
_SAMPLES = 100  # that the step response of nothing but integrators is shown for
_BELOW = 0.3  # of the lowest excited frequency


@dataclass(frozen=True)
class Fitted:
    """A block's model with the uncertainty of its coefficients."""

    model: TransferMatrix  # its transfer functions
    # (n_coefficient, n_root): a root of the covariance of its numerators, channel by channel, then of its denominator
    # without the first.
    root: FloatArray
    integrators: int = 0  # how many of its poles, the slowest, are integrators

    @property
    def coefficients(self) -> FloatArray:
        """The coefficients (n_coefficient,) that are uncertain."""
        return np.concatenate([self.model.numerator.ravel(), self.model.denominator[1:]])

    def deviation(self, slopes: FloatArray) -> FloatArray:
        """Standard deviation (...) of what has these slopes (n_coefficient, ...) by the coefficients."""
        return np.asarray(np.sqrt((np.tensordot(self.root, slopes, (0, 0)) ** 2).sum(axis=0)))

    def nudged(self) -> list[tuple[TransferMatrix, float]]:
        """The model with each coefficient changed a little, and by how much."""
        found = []
        size = self.model.numerator.size
        for index, value in enumerate(self.coefficients):
            step = _NUDGE * (abs(value) or 1.0)
            changed = self.coefficients
            changed[index] += step
            numerator = changed[:size].reshape(self.model.numerator.shape)
            denominator = np.concatenate([[1.0], changed[size:]])
            found.append((replace(self.model, numerator=numerator, denominator=denominator), step))
        return found


def frequency_responses(fitted: Sequence[Fitted], lowest_hz: float) -> Responses:
    """Computes the responses from below the excited band up to half the sampling rate."""
    nyquist_hz = 0.5 / fitted[0].model.sampling_period_s
    frequency_hz = np.geomspace(min(_BELOW * lowest_hz, 0.1 * nyquist_hz), nyquist_hz, _FREQUENCIES)
    omega = 2 * np.pi * frequency_hz
    columns, sampled, deviations = [], [], []
    for one in fitted:
        columns.append(_flat(one.model.response(omega)))
        sampled.append(_flat(one.model.sampled_response(omega)))
        found = response_deviation(one.model, one.root, omega)
        deviations.append([each.reshape(len(omega), -1) for each in (found.magnitude, found.phase_rad)])
    magnitude, phase = (np.hstack([each[index] for each in deviations]) for index in (0, 1))
    return Responses(frequency_hz, np.hstack(columns), np.hstack(sampled), magnitude, phase)


def step_responses(fitted: Sequence[Fitted]) -> StepResponses:
    """Computes the responses to a unit step, with their deviations, until they have settled."""
    times, values, deviations, finals = [], [], [], []
    for one in fitted:
        n_out, n_in = one.model.numerator.shape[:2]
        # What integrates comes to rest nowhere.
        finals += np.where(one.integrators > 0, np.inf, one.model.static_gain).ravel().tolist()
        for place in range(n_out * n_in):
            time = _times(one, place)
            value = _step(one.model, time, place)
            slopes = np.array([(_step(other, time, place) - value) / step for other, step in one.nudged()])
            times.append(time)
            values.append(value)
            deviations.append(one.deviation(slopes))
    time_s, value, std = (np.stack(each, axis=1) for each in (times, values, deviations))
    figures = np.array([_figures(*each) for each in zip(times, values, finals, strict=True)]).T
    return StepResponses(time_s, value, std, *figures)


def root_loci(fitted: Sequence[Fitted]) -> RootLoci:
    """Computes the closed-loop poles of each channel over a proportional gain."""
    n_pole = max(len(one.model.denominator) for one in fitted) - 1
    n_zero = max(one.model.numerator.shape[2] for one in fitted) - 1
    gain = np.concatenate([[0.0], np.geomspace(1e-2, 1e2, _GAINS - 1)])
    paths, zeros, poles = [], [], []
    for one in fitted:
        own = _places(poles_of(one.model, one.root), n_pole)
        for place in np.ndindex(one.model.numerator.shape[:2]):
            numerator = one.model.numerator[place]
            # Closed-loop poles are the roots of A(s) + k B(s); the gain is counted in those of static loop gain one.
            each = gain / _size(numerator, one.model.denominator, one.integrators)
            paths.append([_padded(np.roots(np.polyadd(one.model.denominator, k * numerator)), n_pole) for k in each])
            zeros.append(_places(zeros_of(one.model, one.root, *place), n_zero))
            poles.append(own)
    (zero, zero_std), (pole, pole_std) = (np.swapaxes(np.array(each), 0, 1) for each in (zeros, poles))
    return RootLoci(gain, np.swapaxes(np.array(paths), 0, 1), zero, pole, zero_std, pole_std)


def _places(found: Sequence[Root], count: int) -> tuple[ComplexArray, ComplexArray]:
    """Places (count,) of roots, pairs whole, and deviations (count,) of their real and imaginary parts."""
    places, deviations = [], []
    for each in found:
        both = [each.place] if each.place.imag == 0 else [each.place, np.conj(each.place)]
        places += both
        deviations += len(both) * [complex(np.linalg.norm(each.moves.real), np.linalg.norm(each.moves.imag))]
    return _padded(np.array(places, complex), count), _padded(np.array(deviations, complex), count)


def _size(numerator: FloatArray, denominator: FloatArray, integrators: int) -> float:
    """Static gain; of a channel that has none, or an endless one, the gain amid its poles."""
    with np.errstate(divide="ignore", invalid="ignore"):
        static = float(numerator[-1] / denominator[-1])
    if not integrators and np.isfinite(static) and abs(static) > _NUDGE * np.abs(numerator).max():
        return static
    s = 1j * np.abs(np.roots(denominator)).max()
    return float(abs(np.polyval(numerator, s) / np.polyval(denominator, s))) or 1.0


def _padded(roots: ComplexArray | FloatArray, count: int) -> ComplexArray:
    return np.concatenate([np.asarray(roots, complex), np.full(count - len(roots), np.nan, complex)])


def _flat(values: ComplexArray) -> ComplexArray:
    return values.reshape(len(values), -1)


def _step(model: TransferMatrix, time: FloatArray, place: int) -> FloatArray:
    """Step response (n_time,) of one channel."""
    return np.asarray(model.step(time).reshape(len(time), -1)[:, place])


def _times(fitted: Fitted, place: int) -> FloatArray:
    """Times (n_time,) [s] until a channel has settled, but for its integrators; of one that rings long, first turns."""
    model = fitted.model
    delay_s = model.delay_samples * model.sampling_period_s
    poles = model.poles[np.argsort(np.abs(model.poles))][fitted.integrators :]
    if not poles.size:
        return np.linspace(0, delay_s + _SAMPLES * model.sampling_period_s, _TIMES)
    rates = np.abs(poles.real)
    fastest = np.abs(poles).max()
    slowest = rates[rates > _NUDGE * fastest].min(initial=fastest)
    long = np.linspace(0, delay_s + _TIME_CONSTANTS / slowest, 10 * _TIMES)
    value = _step(model, long, place)
    if fitted.integrators:
        return long[::10]
    away = np.flatnonzero(np.abs(value - value[-1]) > _SETTLED * np.abs(value).max())
    end = long[min(away[-1] + 1, len(long) - 1)] if away.size else long[-1]
    turning = np.abs(poles.imag)
    ringing = turning[(turning > rates) & (rates * end < _RINGS_FOR)]
    if ringing.size:
        end = min(end, delay_s + 2 * np.pi * _TURNS / ringing.max())
    return np.linspace(0, _MARGIN * end, _TIMES)


def _figures(time: FloatArray, value: FloatArray, final: float) -> tuple[float, float, float]:
    """Undershoot, overshoot and rise time of a step response with a final value."""
    if not final or not np.isfinite(final):
        return 0.0, 0.0, np.nan
    share = value / final
    reached = [np.flatnonzero(share >= level) for level in _RISE]
    if not all(each.size for each in reached):
        return max(-share.min(), 0.0), 0.0, np.nan
    first, last = (int(each[0]) for each in reached)
    under = max(-share[: first + 1].min(), 0.0)
    return under, max(share.max() - 1, 0.0), float(time[last] - time[first])
