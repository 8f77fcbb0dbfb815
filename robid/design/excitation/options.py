"""Options of an excitation, one dataclass a signal: what perturbations share, what only one has, and a trajectory."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi
from typing import ClassVar, Literal, TypeAlias

import numpy as np

from robid.arrays import IntArray, option
from robid.signals.pose import ANGLES

FEWEST_LINES = 4  # Frequencies of a band below which there is no response to speak of
_RESOLUTION = "Distance between the response's frequencies, and width of the band averaged around each [Hz]."


@dataclass(frozen=True, kw_only=True)
class ArbitraryOptions:
    """A signal of logs that need not repeat, and of which no line is known; the estimator `local` reads it."""

    signal: Literal["arbitrary"] = option("arbitrary", "A signal that need not repeat, in logs only.")
    low_hz: float = field(metadata={"description": "Lowest frequency of the response [Hz].", "gt": 0})
    high_hz: float = field(metadata={"description": "Highest frequency of the response [Hz].", "gt": 0})
    resolution_hz: float = field(metadata={"description": _RESOLUTION, "gt": 0})

    decides_lines: ClassVar[tuple[str, ...]] = ("signal", "low_hz", "high_hz", "resolution_hz")
    inject: ClassVar[Literal["speed_reference"]] = "speed_reference"
    seed: ClassVar[None] = None

    @property
    def period_s(self) -> float:
        """Length of the segments of a log that have this resolution [s]."""
        return 1 / self.resolution_hz

    def segment_samples(self, sampling_period_s: float) -> int:
        """Returns the samples of a segment, rounded."""
        return max(round(self.period_s / sampling_period_s), 1)

    def lines(self, sampling_period_s: float) -> IntArray:
        """Returns the lines of a segment that lie in the band."""
        n_sample = self.segment_samples(sampling_period_s)
        segment_s = n_sample * sampling_period_s
        lowest, highest = min(self.low_hz * segment_s, n_sample), min(self.high_hz * segment_s, n_sample)
        return np.arange(max(int(np.ceil(lowest - 1e-6)), 1), int(np.floor(highest + 1e-6)) + 1)

    def problems(self, sampling_period_s: float) -> list[str]:
        """Finds what keeps a log of this sampling period [s] from having such a response."""
        problems, nyquist_hz = [], 0.5 / sampling_period_s
        if self.low_hz >= self.high_hz:
            problems.append(f"S136 low_hz {self.low_hz:g} is not below high_hz {self.high_hz:g} (swap them)")
        elif len(self.lines(sampling_period_s)) < FEWEST_LINES:
            finer = (self.high_hz - self.low_hz) / FEWEST_LINES
            problems.append(
                f"S301 the band {self.low_hz:g} to {self.high_hz:g} Hz has fewer than {FEWEST_LINES} frequencies"
                f" {self.resolution_hz:g} Hz apart (lower resolution_hz to {finer:.3g})"
            )
        if self.high_hz + self.resolution_hz > nyquist_hz:
            problems.append(
                f"S304 high_hz {self.high_hz:g} is not a resolution below the Nyquist frequency {nyquist_hz:g} Hz"
                f" (lower high_hz)"
            )
        return problems


_SIGNAL = {
    "description": "Kind of signal. A chirp excites all lines of the band, a stepped sine those near `count` "
    "frequencies. A Fourier series has random phases and may begin and end at rest. A "
    "trajectory moves far, for rigid dynamics. A pose chirp moves the tool, for position in and "
    "position out."
}
_DEG = pi / 180
_COUNT = {"description": "Number of excited lines, of frequencies of a stepped sine.", "ge": 1, "le": 100_000}
_LINES = {
    "description": "In place of `count`, `spacing` and `detection_share`. `all`: lines of the band on the "
    "`grid`. `found`: those of them that a log shows to be excited. Or a list of numbers, in "
    "cycles per period, independent of band and grid."
}
_SPACING = {"description": "How the excited lines, or a stepped sine's frequencies, are spaced."}


@dataclass(frozen=True, kw_only=True)
class Travel:
    """A slow sine of one joint beneath the excitation, so that the response's place moves while it is excited."""

    joint: str = field(metadata={"description": "Name of the joint."})
    amplitude_m: float | None = option(None, "Amplitude of a prismatic joint about the configuration [m].", gt=0)
    amplitude_deg: float | None = option(None, "The same of a revolute joint [deg].", gt=0)
    line: int = option(1, "Its periods in one period of the excitation.", ge=1, le=1_000_000)


@dataclass(frozen=True)
class SignalOptions:
    """What every signal has: period, band, size, limits and what is added to it.

    `decides_lines` names the fields that decide which lines are excited.
    """

    signal: Literal["multisine", "chirp", "stepped_sine", "fourier"] = field(default="multisine", metadata=_SIGNAL)
    period_s: float = option(5.0, "Length of one period [s].", gt=0, le=1e5)
    low_hz: float = option(2.0, "Lowest excited frequency [Hz].", gt=0)
    high_hz: float = option(80.0, "Highest excited frequency [Hz].", gt=0)
    grid: Literal["odd", "full"] = option("odd", "Lines that may be excited: odd ones only, or all.")
    inject: Literal["speed_reference", "position_reference", "torque"] = option(
        "speed_reference", "Where the controller adds the excitation."
    )
    rms: float | tuple[float, ...] = option(
        20.0, "RMS of the injected signal, one for all motors or one each [rad/s, rad or N m]."
    )
    seed: int = option(1, "Seed of the phases and detection lines.", ge=0)
    limit_share: float | None = option(
        None,
        "Scales the RMS of all motors by one factor until this share of the nearest limit is reached. When not "
        "given, `rms` is used as it is.",
        gt=0,
        le=1,
    )
    max_excursion_deg: float = option(5.0, "Limit of each joint's excursion on the arm side [deg].", gt=0)
    max_excursion_m: float = option(0.05, "The same of prismatic joints [m].", gt=0)
    assumed_angle_noise_rad: float = option(
        3e-5, "Motor angle's noise per sample that the plan assumes, quantisation included [rad].", gt=0
    )
    assumed_torque_noise_nm: float = option(0.05, "Torque disturbance per sample that the plan assumes [N m].", ge=0)
    slow_motion_rad_s: float = option(
        0.0,
        "Peak motor speed of a slow motion added against Coulomb friction, which `limit_share` scales too; 0 "
        "adds none [rad/s].",
        ge=0,
    )
    slow_motion_line: int = option(
        2, "Line of the slow motion, even; it and its multiples are never excited.", ge=2, le=1_000_000
    )
    travel: Travel | None = option(
        None,
        "An additional large motion of one joint by the position reference, wherever the excitation is "
        "injected. Limits of the excursion and `rms` do not include it. The campaign is then a record without "
        "a frequency response.",
    )

    decides_lines: ClassVar[tuple[str, ...]] = (
        *("signal", "period_s", "low_hz", "high_hz", "grid", "slow_motion_rad_s", "slow_motion_line"),
    )


@dataclass(frozen=True)
class ChosenLineOptions(SignalOptions):
    """What a signal has whose lines are chosen."""

    count: int = field(default=60, metadata=_COUNT)
    spacing: Literal["log", "linear"] = field(default="log", metadata=_SPACING)
    detection_share: float = option(0.1, "Share of the chosen lines left out to detect distortion.", ge=0, lt=1)
    lines: tuple[int, ...] | Literal["all", "found"] | None = field(default=None, metadata=_LINES)

    decides_lines: ClassVar[tuple[str, ...]] = (
        *SignalOptions.decides_lines,
        *("count", "spacing", "detection_share", "lines", "seed"),
    )


@dataclass(frozen=True)
class MultisineOptions(ChosenLineOptions):
    """An orthogonal random-phase multisine on odd lines with detection lines."""

    signal: Literal["multisine"] = field(default="multisine", metadata=_SIGNAL)
    phase_iterations: int = option(
        60, "Iterations of the crest-factor search at each of seven exponents; 0 keeps random phases.", ge=0, le=10_000
    )
    phase_starts: int = option(
        16,
        "Random starts of the crest-factor search in a block: one per motor, the rest for the largest crest "
        "factor. With `phase_iterations` 0, the best of random draws.",
        ge=1,
        le=10_000,
    )
    random_block_phases: bool = option(
        False,
        "Random phases for each experiment and line of a block. The block stays orthogonal, no signal repeats, "
        "and peaks are higher.",
    )
    crest_at: Literal["reference", "reference_and_motion"] = option(
        "reference", "Where the crest factor is minimised: at the reference, or at the predicted motor speed too."
    )
    amplitude: Literal["flat", "sensitivity"] = option(
        "flat",
        "Amplitudes of a motor's lines: equal, or shaped by the information of each line about springs and dampers.",
    )


@dataclass(frozen=True)
class FourierOptions(ChosenLineOptions):
    """A Fourier series with random phases on chosen lines."""

    signal: Literal["fourier"] = field(default="fourier", metadata=_SIGNAL)
    at_rest: bool = option(False, "Angle, speed and acceleration are zero where the period begins.")


@dataclass(frozen=True)
class ChirpOptions(SignalOptions):
    """A sweep over all lines of the band."""

    signal: Literal["chirp"] = field(default="chirp", metadata=_SIGNAL)
    chirp_peak: float = option(
        0.25, "Where the amplitude is largest, as a share of the sweep; 0 lets it fall throughout.", ge=0, lt=1
    )

    decides_lines: ClassVar[tuple[str, ...]] = (*SignalOptions.decides_lines, "chirp_peak")


@dataclass(frozen=True)
class SteppedSineOptions(SignalOptions):
    """One frequency after the other."""

    signal: Literal["stepped_sine"] = field(default="stepped_sine", metadata=_SIGNAL)
    count: int = field(default=60, metadata=_COUNT)
    spacing: Literal["log", "linear"] = field(default="log", metadata=_SPACING)

    decides_lines: ClassVar[tuple[str, ...]] = (*SignalOptions.decides_lines, "count", "spacing")


@dataclass(frozen=True)
class TrajectoryOptions:
    """A periodic Fourier series of all joints at once over large motions, optimised for rigid dynamics.

    It begins and ends at rest in the configuration, which is its mean, and is one experiment in each realization.
    """

    signal: Literal["trajectory"] = field(default="trajectory", metadata=_SIGNAL)
    period_s: float = option(10.0, "Length of one period [s].", gt=0, le=1e5)
    harmonics: int = option(5, "Lines of the series: 1 to this one.", ge=3, le=1_000)
    inject: Literal["speed_reference", "position_reference"] = option(
        "speed_reference", "Where the controller adds the excitation."
    )
    criterion: Literal["d_optimal", "condition"] = option(
        "d_optimal",
        "Optimised quantity: the determinant of the information about the base parameters, or the condition "
        "number of the regressor with each column over its size in random motions.",
    )
    friction: Literal["none", "viscous", "coulomb", "asymmetric"] = option(
        "coulomb", "Friction of each motor that is among the parameters."
    )
    position_share: float = option(0.9, "Share of the way to the joint limits that may be used.", gt=0, le=1)
    speed_share: float = option(0.8, "Share of the motors' speed limits that may be used.", gt=0, le=1)
    torque_share: float = option(0.8, "Share of the motors' torque limits that may be used.", gt=0, le=1)
    max_acceleration_deg_s2: float | None = option(
        None, "Limit of each joint's acceleration on the arm side [deg/s^2].", gt=0
    )
    max_acceleration_m_s2: float | None = option(None, "The same of prismatic joints [m/s^2].", gt=0)
    starts: int = option(4, "Random starts; the best end is taken.", ge=1, le=1_000)
    evaluations: int = option(200, "Evaluations of the criterion with its slopes from each start.", ge=1, le=100_000)
    seed: int = option(1, "Seed of the starts.", ge=0)

    decides_lines: ClassVar[tuple[str, ...]] = ("signal", "period_s", "harmonics")


@dataclass(frozen=True)
class PoseChirpOptions:
    """A chirp of the commanded pose at the rate of the robot's `pose_interface`, one channel after the other.

    Each channel is one experiment. Realizations repeat the same signal, and so do periods.
    """

    signal: Literal["pose_chirp"] = field(default="pose_chirp", metadata=_SIGNAL)
    channels: tuple[str, ...] = option(
        (),
        "Channels that move, in the order of the experiments: X, Y, Z, A, B, C of the tool, R of a rail or the "
        "names of several external axes. Empty: all channels of the robot.",
    )
    amplitude_mm: float | dict[str, float] = option(
        2.0, "Largest amplitude of lengths, one for all channels or by channel [mm]."
    )
    amplitude_deg: float | dict[str, float] = option(0.1, "The same of angles [deg].")
    period_s: float = option(99.996, "Length of the sweep and of one period [s].", gt=0, le=1e5)
    low_hz: float = option(0.01, "Frequency at its beginning [Hz].", gt=0)
    high_hz: float = option(5.2, "Frequency at its end [Hz].", gt=0)
    chirp_peak: float = option(
        0.0, "Where the amplitude is largest, as a share of the sweep; 0 lets it fall throughout.", ge=0, lt=1
    )

    decides_lines: ClassVar[tuple[str, ...]] = ("signal", "period_s", "low_hz", "high_hz", "chirp_peak")
    inject: ClassVar[Literal["pose_reference"]] = "pose_reference"
    seed: ClassVar[None] = None

    def amplitude(self, channel: str) -> float | None:
        """Returns the largest amplitude of a channel, None where it is not stated [m, or rad]."""
        stated, unit = (self.amplitude_deg, _DEG) if channel in ANGLES else (self.amplitude_mm, 1e-3)
        value = stated.get(channel) if isinstance(stated, dict) else stated
        return None if value is None else value * unit


SweepOptions: TypeAlias = ChirpOptions | SteppedSineOptions
PerturbationOptions: TypeAlias = MultisineOptions | ChirpOptions | SteppedSineOptions | FourierOptions
ExcitationOptions: TypeAlias = PerturbationOptions | TrajectoryOptions | PoseChirpOptions | ArbitraryOptions
