"""Factors by which values of a log are commonly read wrong, and how a finding says which of them it saw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

SCALES: dict[str, float] = {
    "180/pi": float(180 / np.pi),
    "1000": 1e3,
    "1e6": 1e6,
    "60/2pi": float(60 / (2 * np.pi)),
    "6": 6.0,
    "9.81": 9.80665,
    "2pi": float(2 * np.pi),
    "60": 60.0,
}
"""Factors that are the same on every robot: deg for rad, milli, micro, rpm for rad/s, rpm for deg/s, kgf for N, turns
for rad, minutes for seconds."""

OWN_SCALES: dict[str, str] = {
    "gear_ratio": "a motor's gear ratio: its side is mistaken, or nobody reduced it",
    "counts": "counts of an encoder instead of its angle, or a count of another encoder's per turn",
    "torque_constant": "a motor's torque constant: currents that are read as torques",
}
"""Factors that are a robot's own, with what they are."""

COUNTS: tuple[int, ...] = (
    *(1000, 1024, 2000, 2048, 2500, 3600, 4000, 4096, 5000, 8192, 10000, 16384, 20000, 36000, 65536),
    *(2**bits for bits in range(17, 25)),
)
"""Counts per turn that encoders have."""

CHANNELS = ("torque", "motor_angle", "arm_angle", "speed", "acceleration", "time", "current", "position", "command")
"""What may have a wrong scale."""


@dataclass(frozen=True)
class Scale:
    """A wrong scale that a finding saw."""

    channel: str  # What has it, of `CHANNELS`
    factor: str  # Which factor, a key of `SCALES` or of `OWN_SCALES`
    inverse: bool = False  # Whether the values that were read are too small by the factor; they are too large where not
    joints: tuple[str, ...] = ()  # The joints concerned; none for all of them

    def __str__(self) -> str:
        """Writes it as `motor_angle x 180/pi of axis_3`, or with `/` where values are too small."""
        joints = f" of {','.join(self.joints)}" if self.joints else ""
        return f"{self.channel} {'/' if self.inverse else 'x'} {self.factor}{joints}"

    @property
    def what(self) -> str:
        """The channels, in words: `motor angle of axis_3`."""
        return _TITLES[self.channel] + (f" of {', '.join(self.joints)}" if self.joints else "")

    def mistake(self, size: float, what: str | None = None) -> str:
        """Says what would have been read as what, and what to state instead, a clause.

        Args:
            size: The factor itself.
            what: The channels in words, where others have it too.
        """
        what = self.what if what is None else what
        if self.factor == "gear_ratio":
            return _SIDES[self.inverse].format(what)
        if self.factor == "torque_constant":
            return f"currents were read as torques: state `unit: A` and `torque_constant_nm_a: {size:.4g}`"
        if self.factor == "counts":
            return self._counted(size, what)
        kind = next((kind for kind, channels in _KINDS.items() if self.channel in channels), self.channel)
        read, remedy = _READ.get((kind, self.factor, self.inverse), ("", ""))
        if not read:
            small = "small" if self.inverse else "large"
            return f"values come out {size:.4g} times too {small}: state their `unit`, or `scale`, for the {what}"
        return f"{read}: state {remedy}{'' if self.channel == 'time' else f' for the {what}'}"

    def _counted(self, size: float, what: str) -> str:
        counts = size * 2 * np.pi
        if abs(counts - round(counts)) < _WHOLE and counts > min(COUNTS) / 2:
            return (
                f"counts of {counts:.0f} per turn were read as rad: state `unit: counts` and"
                f" `counts_per_turn: {counts:.0f}` for the {what}"
            )
        more = "less" if self.inverse else "more"
        return f"turns have {size:.4g} times {more} counts than was said: correct `counts_per_turn` of the {what}"


def mistake(scales: Sequence[Scale], size: float) -> str:
    """Says what some channels, off alike or one side of the gear for the other, would have been read as: a clause."""
    if len({scale.inverse for scale in scales}) > 1:
        return _OF_JOINTS[scales[0].inverse]
    return scales[0].mistake(size, channels_of(scales))


def channels_of(scales: Sequence[Scale]) -> str:
    """The channels of some scales, in words."""
    return " and of the ".join(scale.what for scale in scales)


def read_scale(text: str) -> Scale:
    """Reads what `str` made of a scale."""
    channel, sign, factor, *joints = text.split(" ", 4)
    return Scale(channel, factor, sign == "/", tuple(joints[1].split(",")) if joints else ())


_WHOLE = 1e-6
_TITLES = {
    "torque": "torque",
    "motor_angle": "motor angle",
    "arm_angle": "arm angle",
    "speed": "speed",
    "acceleration": "acceleration",
    "time": "time",
    "current": "current",
    "position": "position",
    "command": "command",
}
_KINDS = {"angle": ("motor_angle", "arm_angle", "command"), "torque": ("torque", "current")}
_CLOCK = "`sampling_period_s` in seconds, and the unit of `time`"
_READ = {
    ("torque", "1000", False): ("mN m were read as N m", "`unit: mN m`"),
    ("torque", "1000", True): ("N m were read as mN m, or kN m as N m", "`unit: N m`, or `unit: kN m`,"),
    ("torque", "1e6", False): ("uN m were read as N m", "`scale: 1.0e-6`"),
    ("torque", "9.81", False): ("N m were multiplied by 9.81, as if they were kgf m", "`scale: 1`"),
    ("torque", "9.81", True): ("kgf m were read as N m", "`scale: 9.80665`"),
    ("angle", "180/pi", False): ("deg were read as rad", "`unit: deg`"),
    ("angle", "180/pi", True): ("rad were read as deg", "`unit: rad`"),
    ("angle", "1000", False): ("mrad were read as rad", "`unit: mrad`"),
    ("angle", "1000", True): ("rad were read as mrad", "`unit: rad`"),
    ("angle", "1e6", False): ("urad were read as rad", "`unit: urad`"),
    ("angle", "1e6", True): ("rad were read as urad", "`unit: rad`"),
    ("angle", "2pi", False): ("rad were read as turns", "`unit: rad`"),
    ("angle", "2pi", True): ("turns were read as rad", "`unit: turn`"),
    ("position", "1000", False): ("mm were read as m", "`unit: mm`"),
    ("position", "1000", True): ("m were read as mm", "`unit: m`"),
    ("position", "1e6", False): ("um were read as m", "`unit: um`"),
    ("position", "1e6", True): ("m were read as um", "`unit: m`"),
    ("speed", "60/2pi", False): ("rpm were read as rad/s", "`unit: rpm`"),
    ("speed", "60/2pi", True): ("rad/s were read as rpm", "`unit: rad/s`"),
    ("speed", "180/pi", False): ("deg/s were read as rad/s", "`unit: deg/s`"),
    ("speed", "180/pi", True): ("rad/s were read as deg/s", "`unit: rad/s`"),
    ("speed", "1000", False): ("mrad/s were read as rad/s, or mm/s as m/s", "`scale: 0.001`"),
    ("speed", "1000", True): ("m/s were read as mm/s", "`unit: m/s`"),
    ("speed", "6", False): ("deg/s were read as rpm", "`unit: deg/s`"),
    ("speed", "6", True): ("rpm were read as deg/s", "`unit: rpm`"),
    ("speed", "2pi", True): ("turns/s were read as rad/s", "`scale: 6.283185`"),
    ("acceleration", "180/pi", False): ("deg/s^2 were read as rad/s^2", "`unit: deg/s^2`"),
    ("acceleration", "180/pi", True): ("rad/s^2 were read as deg/s^2", "`unit: rad/s^2`"),
    ("acceleration", "1000", False): ("mm/s^2 were read as m/s^2", "`unit: mm/s^2`"),
    ("acceleration", "1000", True): ("m/s^2 were read as mm/s^2", "`unit: m/s^2`"),
    ("acceleration", "9.81", True): ("multiples of g were read as m/s^2", "`scale: 9.80665`"),
    ("time", "1000", False): ("ms were read as s", _CLOCK),
    ("time", "1000", True): ("s were read as ms", _CLOCK),
    ("time", "1e6", False): ("us were read as s", _CLOCK),
    ("time", "1e6", True): ("s were read as us", _CLOCK),
    ("time", "60", False): ("s were read as min", _CLOCK),
    ("time", "60", True): ("min were read as s", _CLOCK),
}
"""What was read as what, and what to state instead, by kind of channel, factor, and whether values are too small."""

_SIDES = {
    False: "the {0} belongs to the other side of the gear, where it is larger by the gear ratio: exchange the sides",
    True: "the {0} belongs to the other side of the gear, where it is smaller by the gear ratio: exchange the sides",
}
_OF_JOINTS = {
    False: (
        "they were those of the joints, behind the gears: name each channel `<joint>.arm`, or, of motors' encoders and "
        "currents, state the gear ratio as `scale` of the angle and 1 over it as that of the torque"
    ),
    True: "they were those of the motors: leave `.arm` out of the channels' names",
}
"""The same where torques and motions are all of the other side of the gear, by whether torques are too small."""
