"""Transfer functions with common poles, and what they answer exactly to held commands, by way of a cascade of poles.

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
    """Builds the cascade of some poles, `1 / a(s)`, or with two copies of each twice, the second time in reverse."""
    poles = [stage.pole for stage in stages]
    # The second copy runs backwards, so that fast poles meet and the cascade of one copy is the head of that of both.
    stages = chain_stages([*poles, *reversed(poles)] if copies == 2 else poles)
    size = stages[-1].states.stop
    A, b = np.zeros((size, size)), np.zeros(size)
    for index, stage in enumerate(stages):
        row, gain, pole = stage.first, stage.gain, stage.pole
        A[row, row] = pole.real
        if stage.is_pair:
            # The pair s = p +- jq in real form, its second state scaled by the gain: [[p, -q^2/g], [g, p]].
            A[row : row + 2, row : row + 2] = [[pole.real, -(pole.imag**2) / gain], [gain, pole.real]]
        if index:
            A[row, row - 1] = gain
        else:
            b[row] = gain
    return Cascade(stages, A, b, _numerators(stages))


def _numerators(stages: tuple[Stage, ...]) -> FloatArray:
    size = stages[-1].states.stop
    rows = np.zeros((size, size))
    # A state is what drove the cascade times all gains so far, over its poles so far: over all poles it has the factors
    # of the later ones above.
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
    """Discretises a cascade exactly by one matrix exponential; `period` is over that of the reference frequency.

    Source:
        Van Loan (1978), "Computing integrals involving the matrix exponential".
    """
    size = len(cascade.b)
    # exp of [[A, b, 0], [0, 0, 1], [0, 0, 0]] T: its last columns are the integrals over a held and over a ramping
    # input.
    augmented = np.zeros((size + 2, size + 2))
    augmented[:size, :size] = cascade.A * period
    augmented[:size, size] = cascade.b * period
    augmented[size, size + 1] = 1.0
    flow = expm(augmented)
    slope = flow[:size, size + 1] if hold == "foh" else np.zeros(size)
    return Held(cascade, flow[:size, :size], flow[:size, size], slope)


def propagate(held: Held, period: float, inputs: FloatArray, start: Start) -> FloatArray:
    """Simulates a cascade's states (n_in, n_state, n_sample) for several inputs (n_in, n_sample).

    The start is zero, but for `periodic`: the steady state of a period, which is over the reference frequency's.
    """
    periodic = start == "periodic"
    # Beyond the last sample a period begins again, and a single shot goes on as it ended.
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
            # Divided by q/g, the second state makes the pair one complex state z+ = exp(pT) z + force: a first-order
            # recursion.
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
        # From zero a period ends at x_N; started at x_0 it ends at mode^N x_0 + x_N, which is x_0 in the steady state.
        returned = lfilter(ahead, behind, force, axis=-1)[:, -1]
        found[:, 0] = 0.0 if standing else returned / (1 - mode ** force.shape[-1])
    memory = mode * found[:, :1]
    found[:, 1:], _ = lfilter(ahead, behind, force[:, :-1], axis=-1, zi=memory)
    return found


@dataclass(frozen=True)
class TransferMatrix:
    """Strictly proper continuous transfer functions with common poles, a delay and a moving average of the inputs."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    numerator: FloatArray  # (n_out, n_in, n_zero + 1): Numerators, highest power of s [rad/s] first
    denominator: FloatArray  # (n_pole + 1,): Denominator, highest power first, which has coefficient 1
    delay_samples: int  # transport delay in samples
    moving_average: int  # samples over which commands are averaged
    sampling_period_s: float
    hold: Hold  # what commands do between samples

    @property
    def poles(self) -> ComplexArray:
        """Poles (n_pole,) [rad/s]."""
        return np.asarray(np.roots(self.denominator), dtype=complex)

    def zeros(self, output: int = 0, input: int = 0) -> ComplexArray:  # noqa: A002
        """Returns the zeros (n_zero,) [rad/s] of one channel."""
        return np.asarray(np.roots(self.numerator[output, input]), dtype=complex)

    @property
    def static_gain(self) -> FloatArray:
        """Static gain (n_out, n_in); infinite with an integrator."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.numerator[..., -1] / self.denominator[-1])

    @property
    def is_stable(self) -> bool:
        """Whether all poles lie in the left half plane."""
        return bool((self.poles.real < 0).all())

    def response(self, omega: FloatArray) -> ComplexArray:
        """Computes the response (n_freq, n_out, n_in) at frequencies [rad/s] with delay, without hold and average."""
        s = 1j * np.asarray(omega)
        # G(s) = B(s) / A(s) exp(-s T_d), in plain powers of s: no samples come in here.
        above = np.moveaxis(_values(self.numerator, s), -1, 0)
        delay = np.exp(-s * self.delay_samples * self.sampling_period_s)
        return np.asarray(above * (delay / _values(self.denominator, s))[:, None, None])

    def sampled_response(self, omega: FloatArray) -> ComplexArray:
        """Computes the response (n_freq, n_out, n_in) at frequencies [rad/s] from samples to samples, hold included."""
        cascade, weights, scale = self.cascade()
        held = discretise(cascade, self.sampling_period_s * scale, self.hold)
        z = np.exp(1j * np.asarray(omega) * self.sampling_period_s)
        drive = held.now + held.slope * (z[:, None] - 1)
        states = np.linalg.solve(z[:, None, None] * np.eye(len(held.now)) - held.A, drive[..., None])[..., 0]
        above = np.einsum("oik,fk->foi", weights, states)
        # Averaging over m samples is the mean of z^-k for k below m; the delay is another power of z.
        powers = z[:, None] ** -(self.delay_samples + np.arange(self.moving_average))
        return np.asarray(above * powers.mean(axis=1)[:, None, None])

    def step(self, time: FloatArray) -> FloatArray:
        """Computes the response (n_time, n_out, n_in) to a unit step at zero over time [s], without hold or average."""
        cascade, weights, scale = self.cascade()
        size = len(cascade.b)
        augmented = np.zeros((size + 1, size + 1))
        augmented[:size, :size], augmented[:size, size] = cascade.A, cascade.b
        since = np.maximum(np.asarray(time) - self.delay_samples * self.sampling_period_s, 0.0) * scale
        states = expm(since[:, None, None] * augmented)[:, :size, size]
        return np.asarray(np.einsum("oik,tk->toi", weights, states))

    def simulate(self, inputs: FloatArray, start: Literal["rest", "periodic"] = "rest") -> FloatArray:
        """Simulates outputs (n_sample, n_out) to commands (n_sample, n_in), from zero or in the steady state."""
        cascade, weights, scale = self.cascade()
        period = self.sampling_period_s * scale
        commands = delayed(inputs, self.delay_samples, self.moving_average, start)
        states = propagate(discretise(cascade, period, self.hold), period, commands, start)
        return np.asarray(np.einsum("oik,ikt->to", weights, states))

    def cascade(self) -> tuple[Cascade, FloatArray, float]:
        """Returns the poles' cascade, its states' weights (n_out, n_in, n_pole) and its reference frequency [rad/s]."""
        scale = reference_frequency(self.denominator)
        cascade = build_cascade(find_stages(scaled(self.denominator, scale)))
        n_pole, n_zero = len(self.denominator) - 1, self.numerator.shape[-1] - 1
        powers = scale ** (np.arange(n_zero, -1.0, -1.0) - n_pole)
        return cascade, cascade.expand(self.numerator * powers), scale


def scaled(denominator: FloatArray, scale: float) -> FloatArray:
    """Returns a denominator (n_pole + 1,) in `s / scale`, with coefficient 1 first."""
    return np.asarray(denominator * scale ** -np.arange(len(denominator), dtype=float))


def reference_frequency(denominator: FloatArray) -> float:
    """Returns a frequency [rad/s] amid the poles of a denominator (n_pole + 1,)."""
    sizes = np.abs(np.roots(denominator))
    moving = sizes[sizes > 1e-9 * sizes.max(initial=0.0)]
    # The geometric mean of the poles keeps powers of s of one size; integrators have no size and are left out.
    return float(np.exp(np.log(moving).mean())) if len(moving) else 1.0


def delayed(inputs: FloatArray, delay_samples: int, moving_average: int, start: Start) -> FloatArray:
    """Averages and delays commands (n_sample, n_in): what the transfer function receives (n_in, n_sample).

    Before came nothing (`rest`), the same period (`periodic`) or the first value (`free`).
    """
    signals = np.ascontiguousarray(np.asarray(inputs, dtype=float).T)
    n_sample = signals.shape[1]
    reach = delay_samples + moving_average - 1
    if reach == 0:
        return signals
    before = {
        "rest": np.zeros((len(signals), reach)),
        "periodic": np.take(signals, np.arange(-reach, 0) % n_sample, axis=1),
        "free": np.repeat(signals[:, :1], reach, axis=1),
    }[start]
    longer = np.concatenate([before, signals], axis=1)
    last = moving_average - 1
    return np.asarray(sum(longer[:, lag : lag + n_sample] for lag in range(last + 1)) / moving_average)


def _values(polynomials: FloatArray, s: ComplexArray) -> ComplexArray:
    """Values (..., n_freq) of polynomials (..., n_power), highest power first."""
    values = np.zeros((*polynomials.shape[:-1], len(s)), dtype=complex)
    for power in range(polynomials.shape[-1]):
        values = values * s + polynomials[..., power, None]
    return values
