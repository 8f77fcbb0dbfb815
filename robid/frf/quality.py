"""What a reader without a model looks at first: how well responses are known, and what delay leaves motors passive."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.frf.channels import saturation_error
from robid.frf.frf import Frf


@dataclass(frozen=True)
class Quality:
    """How well each output's response is known, at the input that moves it the most.

    NaN where a line told too little of all inputs, or where the record does not tell.
    """

    strongest: IntArray  # (n_conf, n_freq, n_out) Index of that input
    relative_std: FloatArray  # (n_conf, n_freq, n_out) Standard deviation over the magnitude
    signal_to_noise_db: FloatArray  # (n_conf, n_freq, n_out) Power over the variance that noise gives it [dB]
    # (n_conf, n_freq, n_out) Multiple coherence: share of the output's power that the response to all inputs explains
    coherence: FloatArray
    # (n_conf, n_freq, n_out) Level of the odd silent lines, as a deviation of the response over its magnitude
    odd: FloatArray
    even: FloatArray  # (n_conf, n_freq, n_out) The same of the even ones


def dropped_lines(frf: Frf) -> BoolArray:
    """Lines (n_conf, n_freq, n_in) that told too little of an input."""
    shape = (*frf.response.shape[:2], frf.response.shape[3])
    return np.zeros(shape, bool) if frf.dropped is None else frf.dropped


def saturated_signals(
    frf: Frf, inputs: Collection[int] | None = None, outputs: Collection[int] | None = None
) -> dict[str, FloatArray]:
    """Share of the time (n_conf,) in which each signal saturates, by what it is; empty where it is unknown.

    Args:
        frf: The response.
        inputs: Indices of the inputs that count; all unless told.
        outputs: Those of the outputs.
    """
    sides = (
        (frf.input_channels, frf.saturated_inputs, inputs),
        (frf.measured_channels or frf.output_channels, frf.saturated_outputs, outputs),
    )
    return {
        f"{channel.name}: {channel.title}": share[:, index]
        for channels, share, chosen in sides
        if share is not None
        for index, channel in enumerate(channels)
        if chosen is None or index in chosen
    }


def worst_saturation(frf: Frf) -> float:
    """Largest share of the time in which an input or output saturates; 0 where none does or it is unknown."""
    return float(max((share.max(initial=0.0) for share in saturated_signals(frf).values()), default=0.0))


def saturation_text(frf: Frf) -> str:
    """Says by how much a saturated signal may put a response off, beyond its uncertainty; empty where none is."""
    share = worst_saturation(frf)
    if not share:
        return ""
    off = f"{100 * saturation_error(share):.2g} %"
    return f"a signal saturates for {100 * share:.2g} % of the time, which may put the response off by {off} and more"


def judge(frf: Frf) -> Quality:
    """Says how well a response is known."""
    size = np.abs(frf.known_response)
    columns = np.sqrt(np.real(np.diagonal(frf.input_factor, axis1=-2, axis2=-1)))
    # Over the input factor's root: the input that gives the best known response, not the largest one.
    reach = np.nan_to_num(size / np.maximum(columns, np.finfo(float).tiny)[..., None, :])
    strongest = reach.argmax(axis=-1)
    unknown = np.full(size.shape[:3], np.nan)

    def share(deviation: FloatArray | None) -> FloatArray:
        if deviation is None:
            return unknown
        chosen, whole = (np.take_along_axis(each, strongest[..., None], -1)[..., 0] for each in (deviation, size))
        known = np.isfinite(chosen) & (whole > 0)
        return np.asarray(np.divide(chosen, whole, out=unknown.copy(), where=known))

    has_variance = frf.total_covariance is not None or frf.noise_covariance is not None
    noise = share(None if frf.noise_covariance is None else np.sqrt(frf.element_variance(noise_only=True)))
    return Quality(
        strongest=strongest,
        relative_std=share(np.sqrt(frf.element_variance()) if has_variance else None),
        signal_to_noise_db=-20 * np.log10(noise, out=unknown.copy(), where=noise > 0),
        coherence=unknown if frf.coherence is None else frf.coherence,
        odd=share(frf.response_level("odd")),
        even=share(frf.response_level("even")),
    )


def middle(values: FloatArray) -> float:
    """Median of what is finite; NaN where nothing is."""
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else float("nan")


def lowest(values: FloatArray) -> float:
    """Smallest of what is finite; NaN where nothing is."""
    finite = values[np.isfinite(values)]
    return float(finite.min()) if finite.size else float("nan")


FEW_SAMPLES = 3.0  # Delay beyond the declared one that controllers and logs usually have
_LONGEST_S = 0.25
_STEP = 1 / 72  # of a turn at the highest line
_OUTSIDE, _DEVIATIONS = 0.17, 3.0  # sine of the ten degrees, and of the noise, that may lead out of the half plane
_FARTHEST = 0.8
_ALLOWED, _NOT_EVEN, _CLEARLY = 0.02, 0.04, 0.1  # share of a motor's lines outside
_LEAST_LINES = 10
_LEAST_BAND = 4.0  # highest over lowest frequency: below, a reversed sign passes for a delay


@dataclass(frozen=True)
class DrivingPoints:
    """Responses of motors to their own torques."""

    frequency_hz: FloatArray  # (n_freq,) Frequencies [Hz]
    response: ComplexArray  # (n_conf, n_freq, n_motor) Acceleration per torque [rad/(s^2 N m)]
    signal_to_noise: FloatArray | None  # (n_conf, n_freq, n_motor) Power over variance; None where no variance is known
    sampling_period_s: float  # Sampling period of the experiment [s]
    hold_period_s: float | None  # Period for which the torque is held; None where it is not [s]


def driving_points(frf: Frf) -> DrivingPoints:
    """Takes the driving points from a response: of the motors whose torque and angle were both recorded."""
    names = [name for name in frf.input_names if name in frf.output_names]
    rows, columns = ([every.index(name) for name in names] for every in (frf.output_names, frf.input_names))
    ratio = frf.signal_to_noise
    return DrivingPoints(
        frequency_hz=frf.frequency_hz,
        response=frf.response[:, :, rows, columns],
        signal_to_noise=None if ratio is None else ratio[:, :, rows, columns],
        sampling_period_s=frf.sampling_period_s,
        hold_period_s=frf.hold_period_s,
    )


@dataclass(frozen=True)
class _Phases:
    """Phases of driving points, the hold's lag taken out, of the motors that show enough."""

    phase: FloatArray  # (n_conf, n_freq, n_motor) [rad]
    omega: FloatArray  # (n_freq, 1) [rad/s]
    margin: FloatArray  # (n_conf, n_freq, n_motor) Sine by which noise may lead out
    used: BoolArray  # (n_conf, n_freq, n_motor) Which lines stand out of their noise
    seen_hz: FloatArray  # (n_seen,) Lines that any motor shows [Hz]

    def share_outside(self, delay_s: float) -> float:
        """Share of the lines at which the median motor would make energy if the delay were this."""
        # sin(phase) < 0 of acceleration per torque is a negative real part of speed per torque: energy comes out.
        outside = (np.sin(self.phase + delay_s * self.omega) < -self.margin) & self.used
        shares = np.sort(outside.sum(axis=(0, 1)) / self.used.sum(axis=(0, 1)))
        return float(shares[(shares.size - 1) // 2])

    def delays_from(self, declared_s: float) -> list[float]:
        """Delays to try: a step turns the highest line by five degrees at most, so that none is passed over."""
        # Beyond a quarter turn from line to line the phases of neighbours say nothing of a delay.
        reach = min(_LONGEST_S, 0.25 / float(np.median(np.diff(np.sort(self.seen_hz)))))
        return np.arange(declared_s, declared_s + reach, _STEP / float(self.seen_hz.max())).tolist()


def _phases(points: DrivingPoints) -> _Phases | None:
    """Prepares driving points; None where too little is seen."""
    ratio = np.full(points.response.shape, np.inf) if points.signal_to_noise is None else points.signal_to_noise
    # Phase noise of a response is 1 / sqrt(2 SNR) radians; three of these and ten degrees may lead out.
    margin = _OUTSIDE + _DEVIATIONS / np.sqrt(2 * np.maximum(ratio, 1e-3))
    used = margin < _FARTHEST
    enough = used.sum(axis=(0, 1)) >= _LEAST_LINES
    used, margin = used[:, :, enough], margin[:, :, enough]
    seen = points.frequency_hz[used.any(axis=(0, 2))]
    if seen.size < 2 or seen.max() < _LEAST_BAND * seen.min():
        return None
    omega = 2 * np.pi * points.frequency_hz[:, None]
    # The hold lags by half a period, which is no delay of the drive.
    phase = np.angle(points.response[:, :, enough]) + 0.5 * (points.hold_period_s or 0.0) * omega
    return _Phases(phase, omega, margin, used, seen)


def undeclared_delay(points: DrivingPoints, declared_s: float) -> float | None:
    """Finds the least delay with which motors absorb energy at all lines, where the declared one falls far short.

    A driving point of a passive structure is positive real: speed per torque has a phase between -90 and 90 degrees,
    acceleration per torque one between 0 and 180, hold and delay apart. Below every antiresonance a motor moves as a
    mass, at 0 degrees, so that the least delay is the true one but for what damping and friction add. Half of the
    motors decide: one with a reversed sign seems to make energy.

    Args:
        points: The driving points.
        declared_s: Delay that is known, hold excluded [s].

    Returns:
        The delay, hold excluded [s]; None where a few samples more than declared will do, where no delay within
        reach would, or where too little is seen.
    """
    phases = _phases(points)
    if phases is None:
        return None
    usual = declared_s + FEW_SAMPLES * points.sampling_period_s
    if phases.share_outside(usual) < _CLEARLY or phases.share_outside(declared_s) < _CLEARLY:
        return None
    tried = phases.delays_from(declared_s)
    found = next((delay for delay in tried if phases.share_outside(delay) <= _ALLOWED), None)
    return found if found is not None and found > usual else None


def is_conjugate(points: DrivingPoints, declared_s: float) -> bool:
    """Whether driving points are passive with their phases turned around, and with no delay as they are.

    The conjugate of a positive real function has phases from -180 to 0 degrees. A delay cannot bring those back where
    they go up and down between the two, as antiresonances and resonances have it. Where a motor moves as a mass, at the
    lowest lines, its phase is near 0 either way; near 180 degrees the response itself is reversed, not its phase.

    Args:
        points: The driving points.
        declared_s: Delay that is known, hold excluded [s].
    """
    phases, turned = _phases(points), _phases(replace(points, response=np.conj(points.response)))
    if phases is None or turned is None:
        return False
    usual = declared_s + FEW_SAMPLES * points.sampling_period_s
    if all(turned.share_outside(delay) > _ALLOWED for delay in turned.delays_from(declared_s) if delay <= usual):
        return False
    lowest = np.argsort(points.frequency_hz)[:_LEAST_LINES]
    if np.median(np.cos(phases.phase[:, lowest][phases.used[:, lowest]])) < 0:
        return False
    if phases.share_outside(declared_s) < _CLEARLY:
        return False
    return all(phases.share_outside(delay) > _NOT_EVEN for delay in phases.delays_from(declared_s))
