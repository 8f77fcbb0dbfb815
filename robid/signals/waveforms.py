"""Signals to play: multisines in orthogonal blocks, slow motions, stepped sines, chirps and smooth steps.

Spectra are changed the least so that motions begin and end at rest.
"""

from __future__ import annotations

from math import comb

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray, check_shape

_SQUARES_MODULO_5 = (0, 1, -1, -1, 1)  # whether an index is a square modulo 5 (1), is none (-1), or is 0


def orthogonal_matrix(size: int) -> ComplexArray:
    """Returns a matrix (n, n) with entries of magnitude 1 and `T T^H = n I`.

    Entries of few phases leave each motor few different signals in a block, and so a lower crest factor:
    Hadamard's +-1 where n is a power of two, +-1 and +-j for n = 6 (`I + jC` with Paley's conference matrix C),
    else the DFT matrix `exp(2 pi j (i-1)(l-1)/n)`.

    Source:
        Dobrowiecki, Schoukens and Guillaume (2006), Optimized excitation signals for MIMO frequency response
        function measurements; Paley (1933) for C.
    """
    from scipy.linalg import hadamard  # settings need only which lines signals have, and start without scipy

    if size & (size - 1) == 0:
        return np.asarray(hadamard(size), complex)
    index = np.arange(size)
    if size == 6:
        conference = np.ones((6, 6))
        conference[0, 0] = 0
        conference[1:, 1:] = np.take(_SQUARES_MODULO_5, (index[:5, None] - index[:5]) % 5)
        return np.eye(6) + 1j * conference
    return np.asarray(np.exp(2j * np.pi * (np.outer(index, index) % size) / size))


def multisine(amplitude: FloatArray, phase: FloatArray, turn: FloatArray | None = None) -> ComplexArray:
    """Spreads one multisine per motor over an orthogonal block of experiments.

    Args:
        amplitude (n_motor, n_lines): Amplitude of each line [any unit].
        phase (n_real, n_motor, n_lines): Phases, new in each realization [rad].
        turn (n_real, n_exp, n_lines): Phases that all motors have in common in an experiment [rad]; none by default.

    Returns:
        Complex amplitudes `R = R_diag T D` (n_real, n_exp, n_lines, n_motor), n_exp = n_motor, D diagonal with the
        turns; the signal is the real part of their sum over the lines.

    Source:
        Wernholt and Moberg (2008), sec. 4; docs/methods, sec. 2.
    """
    n_motor, n_lines = amplitude.shape
    check_shape("phase", phase, "n_real n_motor n_lines", n_motor=n_motor, n_lines=n_lines)
    diagonal = amplitude * np.exp(1j * phase)
    block = np.einsum("rik,ie->reki", diagonal, orthogonal_matrix(n_motor))
    if turn is None:
        return np.asarray(block)
    check_shape("turn", turn, "n_real n_exp n_lines", n_real=len(phase), n_exp=n_motor, n_lines=n_lines)
    return np.asarray(block * np.exp(1j * turn)[..., None])


def time_signal(spectrum: ComplexArray, lines: IntArray, n_sample: int) -> FloatArray:
    """Returns one period (..., n_sample, n_channel) of complex amplitudes (..., n_lines, n_channel) at `lines`."""
    full = np.zeros((*spectrum.shape[:-2], n_sample // 2 + 1, spectrum.shape[-1]), complex)
    full[..., lines, :] = spectrum * (n_sample / 2)
    from scipy.fft import irfft

    return np.asarray(irfft(full, n=n_sample, axis=-2))


def crest_factor(signal: FloatArray) -> FloatArray:
    """Returns peak over RMS along the sample axis of (..., n_sample, n_channel)."""
    return np.asarray(np.abs(signal).max(axis=-2) / np.sqrt(np.mean(signal**2, axis=-2)))


_ROUNDS = 200


def resting_series(coefficients: ComplexArray, lines: IntArray, orders: tuple[int, ...]) -> ComplexArray:
    """Changes a series the least so that derivatives of it vanish at both ends of the period.

    They vanish for the series and for its copies with all phases shifted alike, so that an orthogonal block of
    experiments keeps the condition. Magnitudes stay nearly equal where the conditions allow it.

    Args:
        coefficients (..., n_lines): Complex amplitudes.
        lines (n_lines,): DFT lines.
        orders: Derivatives that vanish: 0 the series itself, 1 its slope, -1 its integral of zero mean.

    Raises:
        ValueError: If there are not more lines than conditions.
    """
    if len(lines) <= len(orders):
        message = f"{len(orders)} conditions need more than {len(lines)} lines"
        raise ValueError(message)
    relative = lines / lines.max()
    conditions = np.array([(1j * relative) ** order for order in orders])
    conditions /= np.linalg.norm(conditions, axis=1, keepdims=True)
    keep = np.eye(len(lines)) - np.linalg.pinv(conditions) @ conditions
    size = np.abs(coefficients)
    for _ in range(_ROUNDS):
        coefficients = coefficients @ keep.T
        coefficients = size * np.exp(1j * np.angle(coefficients))
    return np.asarray(coefficients @ keep.T)


def slow_motion(
    amplitude: float, line: int, n_real: int, n_motor: int, n_sample: int, generator: np.random.Generator
) -> FloatArray:
    """Returns a sine of one low line for every motor and experiment.

    Friction answers it at odd multiples of the line, ripple and gear mesh at sidebands that are multiples of it too,
    since the motor angle repeats with it. The motors reverse one after the other, never all at once, in another
    order of phases in each experiment; each realization begins at random.

    Args:
        amplitude: Peak [any unit].
        line: DFT line.
        n_real: Number of realizations.
        n_motor: Number of motors and of experiments.
        n_sample: Samples of one period.
        generator: Draws the phase of each realization.

    Returns:
        The signal (n_real, n_exp, n_sample, n_motor).
    """
    motor = np.arange(n_motor)
    start = generator.uniform(0, 2 * np.pi, (n_real, 1, 1, 1))
    # Reversals of a motor are half a turn apart: the motors share that half.
    phase = np.pi * (motor[None, :] + motor[:, None]) / n_motor
    turn = 2 * np.pi * line * np.arange(n_sample) / n_sample
    return np.asarray(amplitude * np.cos(turn[None, None, :, None] + start + phase[None, :, None, :]))


def whole_cycles(frequency: FloatArray, n_sample: int) -> IntArray:
    """Shares a length among frequencies: about the same time for each, at least one cycle.

    Args:
        frequency (n_step,): Rising frequencies [cycles per sample].
        n_sample: Length.

    Returns:
        Cycles of each frequency; together they take at most `n_sample`, and less than a cycle of the highest
        frequency is left.

    Raises:
        ValueError: If one cycle of each takes longer.
    """

    def cycles(dwell: float) -> IntArray:
        return np.asarray(np.maximum(np.floor(frequency * dwell), 1).astype(int))

    def length(count: IntArray) -> float:
        return float(np.sum(count / frequency))

    if length(cycles(0.0)) > n_sample:
        message = f"one cycle of each frequency takes {length(cycles(0.0)):.0f} samples, more than {n_sample}"
        raise ValueError(message)
    low, high = 0.0, float(n_sample)
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if length(cycles(middle)) <= n_sample else (low, middle)
    count = cycles(low)
    for step in range(len(frequency)):
        count[step] += int((n_sample - length(count)) * frequency[step])
    return count


def stepped_sine(frequency: FloatArray, n_sample: int) -> FloatArray:
    """Returns a sine of unit amplitude that passes through the frequencies without a jump.

    Args:
        frequency (n_step,): Rising frequencies [cycles per sample]; all are lowered by one common factor so that
            their whole cycles fill the length exactly.
        n_sample: Length.

    Raises:
        ValueError: If one cycle of each takes longer.
    """
    count = whole_cycles(frequency, n_sample)
    duration = count / frequency
    ends = np.concatenate([[0.0], np.cumsum(duration)]) * (n_sample / duration.sum())
    turns = np.concatenate([[0], np.cumsum(count)])
    return np.asarray(np.sin(2 * np.pi * np.interp(np.arange(n_sample), ends, turns)))


def chirp(low: float, high: float, n_sample: int, *, peak: float = 0.25) -> FloatArray:
    """Returns a sine whose frequency rises linearly while its amplitude rises to one and falls to zero.

    Args:
        low: Frequency at the beginning [cycles per sample].
        high: Frequency at the end [cycles per sample].
        n_sample: Length.
        peak: Where the amplitude is largest, as a share of the length; 0 lets it fall throughout.

    Returns:
        The signal (n_sample,), `A(t) sin(2 pi f_1 t + pi (f_2 - f_1) t^2 / T_0)`.

    Source:
        Oliveira et al. (2019), eq. 2.
    """
    time = np.arange(n_sample)
    share = time / n_sample
    rising = share / peak if peak > 0 else np.ones(n_sample)
    amplitude = np.minimum(rising, (1 - share) / (1 - peak))
    return np.asarray(amplitude * np.sin(2 * np.pi * low * time + np.pi * (high - low) * time**2 / n_sample))


PEAK_ACCELERATION = 3.3
"""Largest acceleration over `speed / ramp_s`."""

PEAK_SNAP = 216.0
"""Largest second derivative of the acceleration over `speed / ramp_s^3`."""

_BOXES = 6


def smooth_step(time_s: FloatArray, size: float, speed: float, ramp_s: float) -> FloatArray:
    """Samples a step that moves at a constant speed between two ramps.

    The speed is a rectangle of the step's size smoothed by six equal boxes, so that an inverse that
    differentiates the acceleration four times stays continuous.

    Args:
        time_s (n_time,): Times; the step begins at 0 [s].
        size: Size of the step, with its sign.
        speed: Largest speed, positive; reached where the step lasts longer than its ramps [1/s].
        ramp_s: Duration of each ramp [s].

    Returns:
        Position, speed and acceleration (3, n_time).
    """
    start, stop = (_ramp(np.asarray(time_s, float) - shift, ramp_s) for shift in (0.0, abs(size) / speed))
    return np.asarray(np.sign(size) * speed * (start - stop))


def step_duration_s(size: float, speed: float, ramp_s: float) -> float:
    """Returns how long the step lasts [s]."""
    return abs(size) / speed + ramp_s


def _ramp(time_s: FloatArray, ramp_s: float) -> FloatArray:
    """Position, speed and acceleration (3, n_time) of a ramp to the speed 1."""
    width = ramp_s / _BOXES
    within = np.clip(time_s / width, 0.0, _BOXES)
    late = np.maximum(time_s - ramp_s, 0.0)
    result = np.zeros((3, within.size))
    for box in range(_BOXES + 1):
        part, sign = np.maximum(within - box, 0.0), (-1) ** box * comb(_BOXES, box)
        result += sign * np.array([width * part**7 / 5040, part**6 / 720, part**5 / (120 * width)])
    result[0] += late
    return result
