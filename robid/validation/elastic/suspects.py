"""What a robot file may have wrong by a little: each suspect changes the response in its own way."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.fit.elastic.options import ElasticOptions
from robid.fit.elastic.rest_model import rest_model
from robid.frf.frf import Frf
from robid.robot.derivatives import jacobian
from robid.robot.description import Inertial, Robot
from robid.robot.linearize import LinearModel
from robid.robot.parameters import element_names
from robid.robot.response import ElasticParameters, response, with_values
from robid.validation.elastic.fitted import FittedModel

_MASS_STEP = 0.01
_STEP_M = 1e-3
_TURN_10_HZ = 20 * np.pi
_FARTHEST_MM = 500.0
_OF_LINK = "% of what its link's inertia asks for at 10 Hz"


@dataclass(frozen=True)
class Suspect:
    """Something that may be off, with what it does to the response.

    Attributes:
        cause: What it is, of `robid.validation.doubt.CAUSES`.
        name: Which one, as in `payload` or `axis_2`.
        unit: Unit of the amounts.
        column (n_conf, n_freq, n_out, n_in): Derivative of the log response by the amount.
        positive: Whether only a positive amount makes sense.
        most: Largest amount, of either sign, that makes sense.
    """

    cause: str
    name: str
    unit: str
    column: ComplexArray
    positive: bool = False
    most: float = 100.0


@dataclass(frozen=True)
class _Scene:
    """A fitted model whose robot can be changed."""

    robot: Robot
    frf: Frf
    options: ElasticOptions
    delay_s: float
    model: LinearModel
    values: ElasticParameters

    def log_response(self) -> ComplexArray:
        return np.log(response(self.model, self.values, self.frf.frequency_hz, self.frf.hold_period_s).sampled)

    def changed(self, robot: Robot) -> ComplexArray:
        """Log response of another robot with the fitted values."""
        model = rest_model(robot, self.frf, self.options, self.delay_s, self.values)
        values = with_values(self.values, "link_inertia", self.values.link_inertia + model.axial - self.model.axial)
        return replace(self, robot=robot, model=model, values=values).log_response()


def suspects(robot: Robot, fitted: FittedModel, options: ElasticOptions, delay_s: float) -> list[Suspect]:
    """Lists what may be off in a robot file, linearised at a fitted model.

    Args:
        robot: The robot file that the fit started from, with its campaign's payload.
        fitted: The fitted model in the configurations of its response.
        options: Options of the fit.
        delay_s: Nominal delay of the fit, hold excluded [s].
    """
    scene = _Scene(robot, fitted.problem.frf, options, delay_s, *fitted.linear)
    before = scene.log_response()

    def column(changed: Robot, step: float) -> ComplexArray:
        difference = scene.changed(changed) - before
        return np.asarray((difference.real + 1j * np.angle(np.exp(1j * difference.imag))) / step)

    found = list(_payload(robot, column))
    found += [
        Suspect("masses", f"mass of link {joint.name}", "%", column(_heavier_link(robot, index), 100 * _MASS_STEP))
        for index, joint in enumerate(robot.joints)
    ]
    found += _torque_constants(scene, before)
    found += _gears(scene, fitted.problem.model.rest.deflection)
    found += _arms(scene)
    found += _friction(scene, before)
    return found


def _payload(robot: Robot, column: Callable[[Robot, float], ComplexArray]) -> Iterator[Suspect]:
    """The payload's mass, with its inertia, and its centre of mass."""
    load = robot.payload
    if load.mass_kg <= 0:
        return
    step = _MASS_STEP * load.mass_kg
    heavier = replace(robot, payload=_share(load, 1 + _MASS_STEP))
    yield Suspect("payload", "payload mass", "kg", column(heavier, step), most=load.mass_kg)
    for axis, shift in zip("xyz", _STEP_M * np.eye(3), strict=True):
        moved = replace(robot, payload=replace(load, com_m=load.com_m + shift))
        name = f"payload centre of mass {axis}"
        yield Suspect("payload", name, "mm", column(moved, 1e3 * _STEP_M), most=_FARTHEST_MM)


def _share(body: Inertial, factor: float) -> Inertial:
    """A body of the same shape with another mass."""
    return Inertial(body.mass_kg * factor, body.com_m, body.inertia_kgm2 * factor)


def _heavier_link(robot: Robot, index: int) -> Robot:
    joint = robot.joints[index]
    joints = (
        *robot.joints[:index],
        replace(joint, link=_share(joint.link, 1 + _MASS_STEP)),
        *robot.joints[index + 1 :],
    )
    springs = tuple(
        replace(spring, outboard=_share(spring.outboard, 1 + _MASS_STEP))
        if spring.joint == index and spring.outboard
        else spring
        for spring in robot.springs
    )
    return replace(robot, joints=joints, springs=springs)


def _torque_constants(scene: _Scene, before: ComplexArray) -> list[Suspect]:
    """A measured torque that is too large by a share makes its column of the response too small."""
    found = []
    for index, joint in enumerate(scene.robot.joints):
        column = np.zeros_like(before)
        column[..., index] = -0.01
        found.append(Suspect("torque_constant", f"torque constant of {joint.name}", "%", column))
    return found


def _gears(scene: _Scene, deflection: FloatArray) -> list[Suspect]:
    """Gears that lose energy whatever the speed, and gears whose stiffness depends on their load."""
    found = response(scene.model, scene.values, scene.frf.frequency_hz, scene.frf.hold_period_s)
    slopes = jacobian(scene.model, scene.values, found, ("stiffness",), scene.frf.hold_period_s)
    slopes = slopes * scene.values.stiffness / found.sampled[..., None]
    listed = []
    for index, spring in enumerate(scene.robot.springs):
        if spring.place != "transmission":
            continue
        own, load = slopes[..., index], np.abs(deflection[:, index])
        listed.append(Suspect("gear_nonlinearity", f"losses of {spring.name}", "%", 0.01j * own, positive=True))
        spread = load - load.mean()
        if np.ptp(load) > 0:
            share = 0.01 * spread / np.abs(spread).max()
            listed.append(
                Suspect(
                    "gear_nonlinearity",
                    f"stiffness of {spring.name} by its load",
                    "%",
                    share[:, None, None, None] * own,
                )
            )
    return listed


def _arms(scene: _Scene) -> list[Suspect]:
    """Viscous friction behind elastic transmissions, where nothing estimates it."""
    if "arm_viscous" in scene.options.free:
        return []
    found = response(scene.model, scene.values, scene.frf.frequency_hz, scene.frf.hold_period_s)
    slopes = jacobian(scene.model, scene.values, found, ("arm_viscous",), scene.frf.hold_period_s)
    slopes = slopes * 0.01 * _TURN_10_HZ * scene.values.link_inertia / found.sampled[..., None]
    names = element_names(scene.robot, "arm_viscous")
    return [
        Suspect("arm_friction", f"viscous friction of {joint.name}'s arm", _OF_LINK, slopes[..., index], positive=True)
        for index, (joint, name) in enumerate(zip(scene.robot.joints, names, strict=True))
        if name is not None
    ]


def _friction(scene: _Scene, before: ComplexArray) -> list[Suspect]:
    """Torques of a motor that follow its angle: what is left of a friction that is not viscous."""
    omega = 2 * np.pi * scene.frf.frequency_hz
    whole = np.exp(before)
    rows = [
        scene.frf.output_names.index(name) if name in scene.frf.output_names else None for name in scene.frf.input_names
    ]
    listed = []
    for index, (name, row) in enumerate(zip(scene.frf.input_names, rows, strict=True)):
        if row is None:
            continue
        scale = scene.values.motor_inertia[index] * _TURN_10_HZ**2
        moved = whole[..., :, index, None] * whole[..., row, None, :] / whole / (omega**2)[:, None, None]
        listed += [
            Suspect("friction", f"friction of {name} in phase with its angle", "%", 0.01 * scale * moved),
            Suspect("friction", f"friction of {name} that loses energy", "%", 0.01j * scale * moved),
        ]
    return listed
