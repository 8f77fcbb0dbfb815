"""Logs in a unit of a controller's own, their mapping, rough robot files, and whether what is said names the scale."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import numpy as np
from scipy.io import savemat

from robid.arrays import FloatArray
from robid.results.finding import CAUSES
from robid.results.scale import OWN_SCALES, SCALES, Scale, read_scale
from robid.settings.base import Section
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import Body, JointSection
from robid.settings.sources import Acquire
from robid.signals.log_channels import InputChannel, OutputChannel, UnitName
from robid.signals.log_options import TimeChannel
from robid.signals.record import Record
from robid.studies.settings.defects import LogSignal, Rough, UnitMistake

Log: TypeAlias = dict[str, dict[str, FloatArray]]  # Variables of each experiment, by its name

_SIGNALS = {"torque": "torque", "motor_angle": "angle", "arm_angle": "arm", "speed": "speed"}
"""Variables of a log by the channels that scales name; behind each stands the number of its joint."""

_SPEED_BAND = 0.25  # Share of the sampling rate up to which a drive's speed follows its encoder's


@dataclass(frozen=True)
class Sizes:
    """Factors that are a robot's own."""

    gear_ratio: FloatArray  # (n_joint,) size of each joint's gear ratio
    counts: float  # Counts of a radian of a motor's encoder
    torque_constant: float  # Torque constant of the motors [N m/A]

    def factors(self, scale: Scale) -> FloatArray:
        """Returns what a scale multiplies the values of each joint by (n_joint,)."""
        size = getattr(self, scale.factor) if scale.factor in OWN_SCALES else SCALES[scale.factor]
        factors = np.broadcast_to(np.asarray(size, float), self.gear_ratio.shape)
        return np.asarray(1 / factors if scale.inverse else factors)


def log_of(record: Record, joints: Sequence[str], configuration: int) -> Log:
    """Returns what a controller logs of one configuration: whole periods, every signal in SI units."""
    outputs = record.outputs[0] + record.output_offset[0]
    inputs, names = record.inputs[0], record.output_names
    found: Log = {}
    for real, exp in np.ndindex(inputs.shape[:2]):
        torque, moved = (each[real, exp].reshape(-1, each.shape[-1]) for each in (inputs, outputs))
        one = {"time": record.sampling_period_s * np.arange(len(torque))}
        for number, joint in enumerate(joints, start=1):
            angle = moved[:, names.index(joint)]
            one[f"torque_{number}"] = torque[:, record.input_names.index(joint)]
            one[f"angle_{number}"] = angle
            one[f"speed_{number}"] = _speed(angle, record.sampling_period_s)
            if f"{joint}.arm" in names:
                one[f"arm_{number}"] = moved[:, names.index(f"{joint}.arm")]
        found[f"c{configuration + 1}_r{real + 1}_e{exp + 1}"] = one
    return found


def _speed(angle: FloatArray, period_s: float) -> FloatArray:
    """A drive's speed: the derivative of a steady state's encoder, without what lies above its band."""
    spectrum, line_hz = np.fft.rfft(angle), np.fft.rfftfreq(len(angle), period_s)
    kept = line_hz <= _SPEED_BAND / period_s
    return np.asarray(np.fft.irfft(2j * np.pi * line_hz * kept * spectrum, len(angle)))


def mistaken_log(log: Log, scale: Scale, factors: FloatArray) -> Log:
    """Returns a log in SI units with a channel, or the time stamps, times each joint's factor (n_joint,)."""
    if scale.channel == "time":
        return {name: {**one, "time": one["time"] * factors[0]} for name, one in log.items()}
    changed = {f"{_SIGNALS[scale.channel]}_{number}": factor for number, factor in enumerate(factors.tolist(), start=1)}

    def read(name: str, values: FloatArray) -> FloatArray:
        scaled = values * changed.get(name, 1.0)
        # What counts is a whole number.
        return np.asarray(np.rint(scaled) if scale.factor == "counts" and changed.get(name, 1.0) != 1 else scaled)

    return {experiment: {name: read(name, values) for name, values in one.items()} for experiment, one in log.items()}


def write_log(path: Path, log: Log) -> None:
    """Writes a log as a MAT file, a structure for each experiment."""
    savemat(path, {name: {key: values[:, None] for key, values in one.items()} for name, one in log.items()})


def mapping_of(
    path: Path, joints: Sequence[str], signals: Sequence[LogSignal], period_s: float, options: Mapping[str, Any]
) -> Acquire:
    """Returns the mapping that reads such a log, every channel in SI units, at a stated sampling period [s].

    Where it holds no angles beside the torques, speeds take their place.
    """
    place = "c{configuration}_r{realization}_e{experiment}"
    suffix = {"angle": "", "arm": ".arm", "speed": ".speed" if "angle" in signals else ""}
    units: dict[str, UnitName] = {"speed": "rad/s"}
    numbered = list(enumerate(joints, start=1))
    inputs = (InputChannel(name=joint, variable=f"{place}.torque_{at}", unit="N m") for at, joint in numbered)
    outputs = (
        OutputChannel(name=joint + suffix[signal], variable=f"{place}.{signal}_{at}", unit=units.get(signal, "rad"))
        for signal in signals
        for at, joint in numbered
    )
    read = {"inputs": tuple(inputs), "outputs": tuple(outputs), **options}
    return Acquire(file=str(path), format="mat", sampling_period_s=period_s, **read)


def stamps(place: str = "c{configuration}_r{realization}_e{experiment}") -> TimeChannel:
    """Returns the time channel of such a log."""
    return TimeChannel(variable=f"{place}.time", unit="s")


_DRAWS, _CONSTANT_DRAWS = 3, 4  # keep these draws apart from those of the true robot
_FRICTION = ("viscous_nms_rad", "coulomb_nm", "static_nm")
_STIFFNESS = ("stiffness_nm_rad", "stiffness_n_m")
_DAMPING = ("damping_nms_rad", "damping_ns_m")
_Part = TypeVar("_Part", bound=Section)


class Factors:
    """Draws log-uniform factors."""

    def __init__(self, seed: int, draws: int) -> None:
        """Starts the draws of a robot."""
        self._generator = np.random.default_rng([seed, draws])

    def up_to(self, largest: float) -> float:
        """Returns the next factor, between one over the largest and the largest."""
        return float(np.exp(np.log(largest) * self._generator.uniform(-1, 1)))


def rough_robot(robot: RobotFile, rough: Rough, seed: int) -> RobotFile:
    """Returns a robot file that is roughly that of a robot."""
    factors = Factors(seed, _DRAWS)
    masses = {joint.name: (factors.up_to(rough.mass), factors.up_to(rough.inertia)) for joint in robot.joints}
    joints = tuple(_rough_joint(joint, masses[joint.name], rough, factors) for joint in robot.joints)
    springs = []
    for spring in robot.springs:
        changed = _rough_spring(spring, rough, factors)
        if spring.outboard is not None and spring.joint is not None:
            # Part of the link: lighter or heavier together with it.
            changed = changed.model_copy(update={"outboard": _rough_body(spring.outboard, *masses[spring.joint])})
        springs.append(changed)
    return robot.model_copy(update={"joints": joints, "springs": tuple(springs)})


def rough_torque_constants(n_joint: int, rough: Rough, seed: int) -> FloatArray:
    """Returns the factors (n_joint,) by which torque constants, and so the torques of a log, are off."""
    factors = Factors(seed, _CONSTANT_DRAWS)
    return np.array([factors.up_to(rough.torque_constant) for _ in range(n_joint)])


def _rough_joint(joint: JointSection, masses: tuple[float, float], rough: Rough, factors: Factors) -> JointSection:
    rotor, friction = factors.up_to(rough.rotor_inertia), factors.up_to(rough.friction)
    changed: dict[str, Any] = {}
    if joint.motor is not None:
        law = _scaled(joint.motor.friction, dict.fromkeys(_FRICTION, friction))
        changed["motor"] = _scaled(joint.motor, {"inertia_kgm2": rotor}).model_copy(update={"friction": law})
    if joint.gear is not None:
        changed["gear"] = _rough_spring(joint.gear, rough, factors)
    if joint.link is not None:
        changed["link"] = _rough_body(joint.link, *masses)
    return joint.model_copy(update=changed)


def _rough_body(body: Body, mass: float, beside: float) -> Body:
    tensor = _scaled(body.inertia_kgm2, dict.fromkeys(type(body.inertia_kgm2).model_fields, mass * beside))
    return body.model_copy(update={"mass_kg": body.mass_kg * mass, "inertia_kgm2": tensor})


def _rough_spring(spring: _Part, rough: Rough, factors: Factors) -> _Part:
    stiffness, damping = factors.up_to(rough.spring), factors.up_to(rough.damper)
    return _scaled(spring, dict.fromkeys(_STIFFNESS, stiffness) | dict.fromkeys(_DAMPING, damping))


def _scaled(section: _Part, factors: Mapping[str, float]) -> _Part:
    stated = {key: getattr(section, key) for key in factors}
    return section.model_copy(update={key: value * factors[key] for key, value in stated.items() if value is not None})


UNITS = "units"  # The cause that must be blamed


@dataclass(frozen=True)
class Said:
    """What the tool said of a case."""

    causes: tuple[str, ...]  # The causes that its grade names, the first to blame first; none where it was refused
    scales: tuple[Scale, ...]  # What the first of them says is wrongly scaled
    refusal: str  # Why it was refused; empty where it was not

    @property
    def accuses_units(self) -> bool:
        """Whether units are accused, as the first cause or by any word of a refusal."""
        return self.causes[:1] == (UNITS,) or bool(re.search(r"\bunits?\b", self.refusal, re.IGNORECASE))

    @property
    def first(self) -> str:
        """What is said first, in words."""
        if self.refusal:
            return "refused"
        named = ": ".join([*self.causes[:1], *map(str, self.scales[:1])])
        return named.replace("_", " ") or "nothing"

    def texts(self) -> dict[str, str]:
        """Returns it as texts, which `said_of` reads."""
        scales = _BETWEEN.join(map(str, self.scales))
        return {"causes": _BETWEEN.join(self.causes), "scales": scales, "refusal": self.refusal}


_BETWEEN = "; "


def said_of(causes: str, scales: str, refusal: str) -> Said:
    """Reads what `Said.texts` returns."""
    named, scaled = ([one for one in text.split(_BETWEEN) if one] for text in (causes, scales))
    return Said(tuple(named), tuple(map(read_scale, scaled)), refusal)


def group_of(mistake: UnitMistake, robot: str) -> tuple[Scale, ...]:
    """Returns the scales that give the same data as a mistake on a robot, itself first."""
    return tuple(read_scale(text) for text in (mistake.scale, *mistake.same.get(robot, ())))


def is_named(said: Said, mistake: UnitMistake, robot: str, joints: Sequence[str], wrong: Sequence[str]) -> bool:
    """Whether a mistake's group is named first, `wrong` being the joints whose channel has it.

    A refusal names it by its words; a grade by the likeliest scale of its first cause, on no joint that is right.
    """
    if said.refusal:
        group_told = group_of(mistake, robot) if CAUSES[UNITS] in said.refusal else ()
        # What a message says was read as what, without its remedy.
        told = (scale.mistake(SCALES.get(scale.factor, 1.0)).partition(":")[0] for scale in group_told)
        return any(words.lower() in said.refusal.lower() for words in (*told, *mistake.refusals))
    if said.causes[:1] != (UNITS,) or not said.scales:
        return False
    first = said.scales[0]
    concerned = first.joints or tuple(joints)
    group = {(scale.channel, scale.factor, scale.inverse) for scale in group_of(mistake, robot)}
    return (first.channel, first.factor, first.inverse) in group and set(concerned) <= set(wrong)
