"""The kinds of parameters of an elastic robot: whose they are, units, titles, bounds, and the parameters' names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import LOCATED, Robot

LogarithmicKind = Literal["stiffness", "damping", "motor_inertia", "link_inertia"]
ResponseNuisance = Literal["viscous", "arm_viscous", "delay"]
ElasticKind = Literal[
    "stiffness", "damping", "viscous", "arm_viscous", "motor_inertia", "link_inertia", "delay", "cubic", "location",
]  # fmt: skip
RigidKind = Literal[
    "inertia", "first_moment", "mass", "motor_inertia", "viscous", "coulomb", "load_friction", "quadratic_viscous",
    "torque_offset",
    "coupling_inertia", "coupling_viscous", "coupling_coulomb",
    "counterbalance", "counterbalance_stiffness", "counterbalance_preload", "counterbalance_pressure",
]  # fmt: skip
Owner = Literal["spring", "transmission", "point", "motor", "link", "drives", "torque", "component"]

_AXIS_TOLERANCE = 1e-9
_BARE: tuple[Owner, ...] = ("point", "drives", "torque", "component")


@dataclass(frozen=True)
class ParameterKind:
    """What a kind of parameters is."""

    title: str  # Heading of a table of them
    # What has one each: springs, transmissions, the joints' motors or links; points of springs have one for each axis,
    # the drives one together. Compensated torques have theirs by coefficient, rigid links and what has a direction or a
    # harmonic theirs by component.
    owner: Owner
    unit: str  # SI unit where it belongs to a hinge or a motor
    linear_unit: str  # SI unit where it belongs to a prismatic joint
    field: str = ""  # Where the robot file states it, from its spring or joint on
    linear_field: str = ""  # The same of a prismatic joint
    logarithmic: bool = False  # Whether it is positive and estimated as the logarithm of a factor
    is_free: bool = False  # Whether a fit estimates it unless something else is said
    through_rest: bool = False  # Whether it only acts through where springs rest and how stiff they are there
    symbol: str = ""  # Its letter, where it is a ratio to an unknown torque constant
    wears: bool = False  # Whether it grows with wear, so that a small value is nothing to worry about
    panel: str = ""  # Heading of the figure that shows it as a ratio to the robot file; empty for none

    @property
    def fields(self) -> tuple[str, str]:
        """Where the robot file states it, of joints that turn and of those that slide."""
        return self.field, self.linear_field

    @property
    def lower(self) -> float:
        """What every value of this kind lies above."""
        return 0.0 if self.logarithmic else -np.inf


PARAMETER_KINDS = {
    "stiffness": ParameterKind(
        "Springs", "spring", "N m/rad", "N/m", "stiffness_nm_rad", "stiffness_n_m",
        logarithmic=True, is_free=True, symbol="k", panel="Springs",
    ),
    "damping": ParameterKind(
        "Dampers", "spring", "N m s/rad", "N s/m", "damping_nms_rad", "damping_ns_m",
        logarithmic=True, is_free=True, symbol="d", panel="Dampers",
    ),
    "viscous": ParameterKind(
        "Equivalent viscous friction", "motor", "N m s/rad", "N m s/rad",
        "motor.friction.viscous_nms_rad", "motor.friction.viscous_nms_rad", is_free=True, symbol="d",
    ),
    "arm_viscous": ParameterKind(
        "Viscous friction of the arm", "link", "N m s/rad", "N s/m",
        "arm_viscous_nms_rad", "arm_viscous_ns_m", symbol="d2",
    ),
    "motor_inertia": ParameterKind(
        "Motor inertias", "motor", "kg m^2", "kg m^2", "motor.inertia_kgm2", "motor.inertia_kgm2",
        logarithmic=True, is_free=True, symbol="J1", panel="Inertias",
    ),
    "link_inertia": ParameterKind(
        "Link inertias", "link", "kg m^2", "kg", "link.inertia_kgm2", "link.mass_kg",
        logarithmic=True, symbol="J2", panel="Inertias",
    ),
    "delay": ParameterKind("Delay", "drives", "s", "s", is_free=True),
    "cubic": ParameterKind(
        "Cubic stiffness", "transmission", "N m/rad^3", "N/m^3", "cubic_nm_rad3", "cubic_n_m3",
        through_rest=True, symbol="k3",
    ),
    "location": ParameterKind("Locations of springs", "point", "m", "m", through_rest=True),
    "doubt": ParameterKind("What the robot file may have wrong", "component", "1", "1"),
    "friction": ParameterKind("Torque nonlinearities (nuisance)", "torque", "1", "1"),
    "inertia": ParameterKind(
        "Inertias about the joint frames' origins", "component", "kg m^2", "kg m^2",
        "link.inertia_kgm2", "link.inertia_kgm2",
    ),
    "first_moment": ParameterKind(
        "First moments", "component", "kg m", "kg m", "link.com_m", "link.com_m",
    ),
    "mass": ParameterKind("Masses", "component", "kg", "kg", "link.mass_kg", "link.mass_kg"),
    "coulomb": ParameterKind(
        "Coulomb friction", "component", "N m", "N m", "motor.friction.coulomb_nm", "motor.friction.coulomb_nm",
    ),
    "load_friction": ParameterKind("Friction per motor torque", "motor", "1", "1"),
    "quadratic_viscous": ParameterKind(
        "Friction with the square of the speed", "motor", "N m s^2/rad^2", "N m s^2/rad^2",
    ),
    "torque_offset": ParameterKind("Torque offsets", "motor", "N m", "N m"),
    "coupling_inertia": ParameterKind("Inertias of coupled gears, arm side", "motor", "kg m^2", "kg"),
    "coupling_viscous": ParameterKind("Viscous friction of coupled gears, arm side", "motor", "N m s/rad", "N s/m"),
    "coupling_coulomb": ParameterKind("Coulomb friction of coupled gears, arm side", "motor", "N m", "N"),
    "counterbalance": ParameterKind(
        "Torque of counterbalances", "component", "N m", "N", "counterbalance", "counterbalance",
    ),
    "counterbalance_stiffness": ParameterKind(
        "Stiffness of counterbalances", "motor", "N/m", "N/m",
        "counterbalance.stiffness_n_m", "counterbalance.stiffness_n_m",
    ),
    "counterbalance_preload": ParameterKind(
        "Preload of counterbalances", "motor", "N", "N", "counterbalance.preload_n", "counterbalance.preload_n",
    ),
    "counterbalance_pressure": ParameterKind(
        "Rest pressure of counterbalances", "motor", "Pa", "Pa",
        "counterbalance.rest_pressure_pa", "counterbalance.rest_pressure_pa",
    ),
    "lost_motion": ParameterKind("Lost motion of gears at 3 % of the rated torque", "link", "rad", "m", wears=True),
    "hysteresis": ParameterKind("Hysteresis of gears: width of the loop at zero torque", "link", "rad", "m"),
    "stepped_stiffness": ParameterKind(
        "Stiffness of gears from the torques of their data sheets on", "link", "N m/rad", "N/m",
    ),
    "slip": ParameterKind("Hysteresis torques of gears", "link", "N m", "N"),
    "backlash": ParameterKind("Backlash of gears", "link", "rad", "m", wears=True),
    "encoder_lag": ParameterKind("Lags of arm encoders behind motor encoders", "link", "s", "s"),
    "damping_time": ParameterKind("Damping over stiffness, with the lag of the torque", "link", "s", "s"),
    "encoder_scale": ParameterKind("Scales of arm encoders against motor encoders", "link", "1", "1"),
    "encoder_offset": ParameterKind("Offsets of arm encoders against motor encoders", "link", "rad", "m"),
    "transmission_error": ParameterKind(
        "Transmission errors and eccentricities: amplitudes", "component", "rad", "m", wears=True,
    ),
    "transmission_phase": ParameterKind("Transmission errors and eccentricities: phases", "component", "rad", "rad"),
    "gain": ParameterKind("Static gains of transfer functions", "component", "1", "1"),
    "gain_per_second": ParameterKind("Gains of integrators, per second", "component", "1/s", "1/s"),
    "integrator": ParameterKind(
        "Integrators: poles slower than their records show, as rates", "component", "rad/s", "rad/s",
    ),
    "pole": ParameterKind("Real poles, as rates", "component", "rad/s", "rad/s"),
    "pole_frequency": ParameterKind("Natural frequencies of pole pairs", "component", "rad/s", "rad/s"),
    "pole_damping": ParameterKind("Damping ratios of pole pairs", "component", "1", "1"),
    "zero": ParameterKind("Real zeros, as rates", "component", "rad/s", "rad/s"),
    "zero_frequency": ParameterKind("Natural frequencies of zero pairs", "component", "rad/s", "rad/s"),
    "zero_damping": ParameterKind("Damping ratios of zero pairs", "component", "1", "1"),
}  # fmt: skip
"""All kinds by name, in the order in which tables show them."""

ELASTIC: tuple[ElasticKind, ...] = (
    "stiffness", "damping", "viscous", "arm_viscous", "motor_inertia", "link_inertia", "delay", "cubic", "location",
)  # fmt: skip
"""Kinds that the elastic model has; the others belong to measured torques, rigid models and transfer functions."""
FREE: tuple[ElasticKind, ...] = tuple(kind for kind in ELASTIC if PARAMETER_KINDS[kind].is_free)
"""Kinds that a fit estimates unless something else is said."""
LOGARITHMIC = tuple(name for name, kind in PARAMETER_KINDS.items() if kind.logarithmic)
"""Kinds that are positive and estimated as logarithms."""
DIRECT = tuple(kind for kind in ELASTIC if not PARAMETER_KINDS[kind].through_rest)
"""Kinds that are in the dynamic stiffness itself."""
OF_SPRINGS = tuple(kind for kind in ELASTIC if PARAMETER_KINDS[kind].owner == "spring")
"""Kinds of which every spring has one."""
RESPONSE_NUISANCE = tuple(kind for kind in DIRECT if kind not in LOGARITHMIC)
"""Kinds that are of no interest themselves: a response shows them, and a robot file says little of them."""
NUISANCE_KIND = (
    "doubt"  # Kind of the parameters that a user has estimated because the robot file may be wrong; its key in files
)
INTEGRATOR_KIND = "integrator"
"""Poles that cannot be distinguished from zero: their values mean no more than that."""
FRICTION_KIND = "friction"
"""Errors of the torques that were subtracted, which a fit estimates only to get them out of the way."""


class NamedSpring(Protocol):
    """What a spring's name and place are read from."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def place(self) -> str:
        """Where it sits."""


def names_of(kind: str, springs: Sequence[NamedSpring], joints: Sequence[str]) -> list[str | None]:
    """Names of a kind's elements, in the order of its values; None for what no spring of that place has.

    Args:
        kind: Of `ELASTIC`.
        springs: The robot's springs.
        joints: Names of its joints.
    """
    owner = PARAMETER_KINDS[kind].owner
    if owner == "drives":
        return [kind]
    if owner == "point":
        return [f"{s.name}.{kind}_{axis}" if s.place in LOCATED else None for s in springs for axis in "xyz"]
    if owner == "transmission":
        return [f"{s.name}.{kind}" if s.place == "transmission" else None for s in springs]
    owners = [s.name for s in springs] if owner == "spring" else joints
    return [f"{name}.{kind}" for name in owners]


def element_names(robot: Robot, kind: str) -> list[str | None]:
    """Names of a kind's elements, in the order of its values; None for what no fit estimates."""
    names = names_of(kind, robot.springs, [joint.name for joint in robot.joints])
    if kind == "arm_viscous":
        # The arm of a rigid joint moves as its motor does, whose friction says it all.
        return [None if rigid else name for name, rigid in zip(names, robot.rigid.tolist(), strict=True)]
    if PARAMETER_KINDS[kind].owner != "point":
        return names
    # A spring that moves along its own axis stays the same spring.
    along = [share > 1 - _AXIS_TOLERANCE for spring in robot.springs for share in np.abs(spring.axis).tolist()]
    return [None if same else name for name, same in zip(names, along, strict=True)]


def element_units(robot: Robot, kind: str) -> list[str]:
    """Units of a kind's elements, in the order of its values."""
    about = PARAMETER_KINDS[kind]
    if about.owner == "drives":
        return [about.unit]
    if about.owner == "point":
        return [about.unit] * (3 * len(robot.springs))
    if about.owner in ("spring", "transmission"):
        return [about.linear_unit if robot.is_linear(spring) else about.unit for spring in robot.springs]
    return [about.linear_unit if slides else about.unit for slides in robot.prismatic.tolist()]


def coefficient_unit(name: str) -> str:
    """Unit of a coefficient of a compensated torque, by its name."""
    return "samples" if name.endswith(".lag") else PARAMETER_KINDS[FRICTION_KIND].unit


def kind_of_name(name: str) -> str:
    """Kind of a parameter of the elastic model by its name."""
    suffix = name.rpartition(".")[2]
    return next((kind for kind in ELASTIC if suffix.startswith(f"{kind}_")), suffix)


def owner_of(name: str, kind: str) -> str:
    """What a parameter belongs to, where its name is made of that and its kind; else its whole name."""
    return name if PARAMETER_KINDS[kind].owner in _BARE else name.removesuffix(f".{kind}")


def name_of(owner: str, kind: str) -> str:
    """Returns the name of a parameter from what `owner_of` made of it."""
    return owner if PARAMETER_KINDS[kind].owner in _BARE else f"{owner}.{kind}"


def viscous_scale(inertia: FloatArray) -> FloatArray:
    """What is natural to viscous friction (n_joint,): what an inertia asks for at 1 Hz [N m s/rad, or N s/m].

    Args:
        inertia (n_joint,): Inertia of each, or mass of links that slide [kg m^2, or kg].
    """
    # At 1 Hz the torque w d q' of a damper is that of the inertia w^2 J where d = 2 pi J.
    return np.asarray(2 * np.pi * inertia)
