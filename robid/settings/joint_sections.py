"""What a joint of a robot file has: its frame, counterbalance, transmission, stiffness over a position, deviations."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, TypeAlias

import numpy as np
from pydantic import Field

from robid.arrays import FloatArray, option
from robid.robot.balances import Counterbalance, GasBalance, HarmonicBalance, SpringBalance
from robid.robot.description import StiffnessLaw
from robid.robot.inertia import turn_about
from robid.robot.nuisance import NuisanceStd
from robid.robot.parameters import PARAMETER_KINDS
from robid.settings.base import Assumed, Name, Section, Vector

if TYPE_CHECKING:
    from robid.settings.robot_sections import JointSection


_POINT_KEYS = ("carrier_point_m", "link_point_m", "free_length_m")
SPRING_KEYS = (*_POINT_KEYS, "stiffness_n_m")
GAS_ALONE = ("area_m2", "rest_pressure_pa", "rest_volume_m3", "exponent")
GAS_KEYS = (*_POINT_KEYS, *GAS_ALONE)
HARMONIC_KEYS = ("sine_nm", "cosine_nm")


class CounterbalanceSection(Assumed):
    """What takes gravity off a motor: harmonics of the joint's angle, a spring or a gas cylinder between points."""

    sine_nm: tuple[float, ...] = option(
        (), "Torque on the arm per sine of the joint's angle, of twice the angle and so on [N m]."
    )
    cosine_nm: tuple[float, ...] = option((), "The same per cosine [N m].")
    carrier_point_m: Vector | None = option(
        None, "End of spring or cylinder on what carries the joint, in the link's frame as it is at zero position [m]."
    )
    link_point_m: Vector | None = option(None, "Its end on the link, in the link's frame [m].")
    free_length_m: float | None = option(
        None,
        "Length at which the spring pulls with `preload_n`, or the gas has its rest pressure and volume [m].",
        ge=0,
    )
    stiffness_n_m: float | None = option(None, "Stiffness of the spring [N/m].", ge=0)
    preload_n: float = option(0.0, "Pull of the spring at its free length; negative where it pushes [N].")
    area_m2: float | None = option(
        None,
        "Of a gas cylinder: area on which the gas presses when the cylinder is extended and compresses it; "
        "negative where it pushes the ends apart [m^2].",
    )
    rest_pressure_pa: float | None = option(
        None, "Of a gas cylinder: pressure of the gas at the free length, over that of the surroundings [Pa].", gt=0
    )
    rest_volume_m3: float | None = option(
        None, "Of a gas cylinder: volume of the gas at the free length, accumulators included [m^3].", gt=0
    )
    exponent: float | None = option(
        None,
        "Of a gas cylinder: polytropic exponent. It is 1 for constant temperature, 1.4 without exchange of "
        "heat, and in between for most.",
        ge=1,
        le=2,
    )

    def counterbalance(self, position: FloatArray, rotation: FloatArray) -> Counterbalance:
        """Returns the plain description, by origin (3,) [m] and orientation (3, 3) of the link in the joint frame."""
        if self.carrier_point_m is None or self.link_point_m is None or self.free_length_m is None:
            n_harmonic = max(len(self.sine_nm), len(self.cosine_nm))
            levels = [np.pad(level, (0, n_harmonic - len(level))) for level in (self.sine_nm, self.cosine_nm)]
            return HarmonicBalance(np.asarray(levels[0], float), np.asarray(levels[1], float))
        carrier, link = (position + rotation @ np.array(end) for end in (self.carrier_point_m, self.link_point_m))
        area, pressure, volume, exponent = self.area_m2, self.rest_pressure_pa, self.rest_volume_m3, self.exponent
        if area is None or pressure is None or volume is None or exponent is None:
            return SpringBalance(carrier, link, self.free_length_m, self.stiffness_n_m or 0.0, self.preload_n)
        return GasBalance(carrier, link, self.free_length_m, area, pressure, volume, exponent)


_FOR_ALL = "in place of the robot's; 0 means no error"


class JointNuisanceStd(Section):
    """Standard deviations of what a robot file may have wrong of one joint."""

    mass_relative_std: float | None = option(None, f"Of the link's mass, {_FOR_ALL}.", ge=0)
    com_m: float | None = option(None, f"Of the link's centre of mass, {_FOR_ALL} [m].", ge=0)
    inertia_relative_std: float | None = option(
        None, f"Of the link's inertia about its centre of mass, {_FOR_ALL}.", ge=0
    )
    torque_relative_std: float | None = option(None, f"Of the motor's torque constant, {_FOR_ALL}.", ge=0)
    coupling_std: float | None = option(None, f"Of the joint's gear couplings, {_FOR_ALL}.", ge=0)
    arm_friction: float | None = option(None, f"Of viscous friction behind the transmission, {_FOR_ALL}.", ge=0)
    friction: float | None = option(None, f"Of the friction that remains in the motor's torque, {_FOR_ALL}.", ge=0)
    loss_factor: float | None = option(None, f"Of the largest loss factor of the gear's hysteresis, {_FOR_ALL}.", ge=0)
    stiffness_relative_std: float | None = option(
        None, f"Of the joint's springs where no fit estimates them, {_FOR_ALL}.", ge=0
    )
    damping_relative_std: float | None = option(
        None, f"Of the joint's dampers where no fit estimates them, {_FOR_ALL}.", ge=0
    )
    load_stiffness: float | None = option(
        None, f"Of the gear's stiffness over the range of its loads, {_FOR_ALL}.", ge=0
    )
    compliance: float | None = option(None, f"Of the compliance of bearings that the file lacks, {_FOR_ALL}.", ge=0)
    zero_deg: float | None = option(None, f"Of the joint's zero, {_FOR_ALL} [deg].", ge=0)
    chain_compliance: float | None = option(
        None, f"Of the share of the gear's fitted compliance that belongs to other parts, {_FOR_ALL}.", ge=0
    )

    def over(self, robot: NuisanceStd) -> NuisanceStd:
        """Returns the robot's deviations with what is said of this joint."""
        return replace(robot, **self.model_dump(exclude_none=True))


Coefficients = Annotated[tuple[float, ...], Field(min_length=1)]


class StiffnessOver(Section):
    """A factor on a spring's stiffness by the position of a joint: a table, or a polynomial of either kind."""

    joint: Name = Field(description="Name of the joint.")
    positions_m: Coefficients | None = option(
        None, "Table: positions of a prismatic joint, ascending, over all of its range [m]."
    )
    positions_deg: Coefficients | None = option(
        None, "Table: angles of a revolute joint, ascending, over all of its range [deg]."
    )
    factors: Annotated[tuple[Annotated[float, Field(gt=0)], ...], Field(min_length=2)] | None = option(
        None, "Table: factor on the stiffness at each of these positions, with monotone cubics in between."
    )
    stiffness: Coefficients | None = option(
        None, "In place of a table: the factor as a polynomial of the position [m, or rad], constant first."
    )
    compliance: Coefficients | None = option(
        None,
        "In place of a table: one over the factor as such a polynomial. Use `[1, slope]` for springs in series "
        "of which one grows with the position, as a screw from its fixed bearing to the nut.",
    )

    @property
    def forms(self) -> tuple[str, ...]:
        """Names of the forms that are written: one, if the section is right."""
        given = {
            "factors": any(part is not None for part in (self.factors, self.positions_m, self.positions_deg)),
            "stiffness": self.stiffness is not None,
            "compliance": self.compliance is not None,
        }
        return tuple(name for name, is_there in given.items() if is_there)

    @property
    def positions(self) -> tuple[float, ...]:
        """Positions of the table [rad, or m]."""
        if self.positions_m is not None:
            return self.positions_m
        return tuple(np.deg2rad(self.positions_deg or ()).tolist())

    def law(self, joints: tuple[JointSection, ...]) -> StiffnessLaw:
        """Returns the plain description."""
        joint = [each.name for each in joints].index(self.joint)
        if self.factors is not None:
            return StiffnessLaw(joint, "table", np.array(self.factors), np.array(self.positions))
        if self.stiffness is not None:
            return StiffnessLaw(joint, "stiffness", np.array(self.stiffness))
        return StiffnessLaw(joint, "compliance", np.array(self.compliance))


class SpringDamper(Assumed):
    """Stiffness and damping of a spring-damper pair, arm side: turning, or of a prismatic joint's transmission."""

    stiffness_nm_rad: float | None = option(None, "Stiffness [N m/rad].", gt=0)
    damping_nms_rad: float | None = option(None, "Damping [N m s/rad].", ge=0)
    cubic_nm_rad3: float | None = option(
        None, "Coefficient of the cubic, stiffening part; 0 when not given [N m/rad^3].", ge=0
    )
    stiffness_n_m: float | None = option(None, "Transmission of a prismatic joint: stiffness [N/m].", gt=0)
    damping_ns_m: float | None = option(None, "Transmission of a prismatic joint: damping [N s/m].", ge=0)
    cubic_n_m3: float | None = option(
        None, "Transmission of a prismatic joint: coefficient of the cubic part; 0 when not given [N/m^3].", ge=0
    )
    stiffness_over: StiffnessOver | None = option(
        None,
        "Dependence of the stiffness and its cubic part on a joint's position, as a factor on the numbers "
        "above. The damping does not depend on it.",
    )

    def value(self, kind: str, *, linear: bool) -> float | None:
        """Returns a stated value of a kind of parameters, of a spring that turns, or works along a line."""
        about = PARAMETER_KINDS[kind]
        value: float | None = getattr(self, about.linear_field if linear else about.field)
        return value


class GearSection(SpringDamper):
    """The transmission of a joint, arm side: short for a spring `gear_<joint>` at the place `transmission`."""


Matrix: TypeAlias = tuple[Vector, Vector, Vector]


class Dh(Assumed):
    """Standard Denavit-Hartenberg parameters: Rz(q + offset) Tz(d) Tx(a) Rx(alpha); prismatic, q is added to d."""

    d_m: float = option(0.0, "Translation along the joint axis [m].")
    a_m: float = option(0.0, "Translation along the turned x axis [m].")
    alpha_deg: float = option(0.0, "Turn about the turned x axis [deg].")
    offset_deg: float = option(0.0, "Joint angle of the DH frame at zero robot angle [deg].")

    def link_frame(self) -> tuple[FloatArray, FloatArray]:
        """Returns position (3,) [m] and orientation (3, 3) of the DH frame at the link's end in the joint frame."""
        return np.array([self.a_m, 0.0, self.d_m]), turn_about("x", self.alpha_deg)

    def joint_frame(self) -> tuple[FloatArray, FloatArray]:
        """Returns position (3,) [m] and orientation (3, 3) of the joint frame in the previous link's frame."""
        return np.zeros(3), turn_about("z", self.offset_deg)


class Frame(Assumed):
    """A joint's frame, its axis along z, in the previous joint's frame at zero angle; links are given in it."""

    position_m: Vector = option((0.0, 0.0, 0.0), "Origin [m].")
    rotation: Matrix = option(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), "Orientation, row by row.")

    def joint_frame(self) -> tuple[FloatArray, FloatArray]:
        """Returns position (3,) [m] and orientation (3, 3) of the joint frame in the previous link's frame."""
        return np.array(self.position_m), np.array(self.rotation)

    def link_frame(self) -> tuple[FloatArray, FloatArray]:
        """Returns position (3,) [m] and orientation (3, 3) of the link's frame in the joint frame: the same frame."""
        return np.zeros(3), np.eye(3)
