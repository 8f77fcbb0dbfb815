"""What fits hand on to others: motor friction, standard parameters, robots with the masses of a rigid fit, gears.

Families never import each other: what is handed on is read from what every model has and from `rigid/standard`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Artifact
from robid.artifacts.results import estimate_from_artifact
from robid.errors import DataError
from robid.results.estimate import Estimate
from robid.results.gears import KnownGear, known_gears
from robid.robot.description import Inertial, Robot
from robid.robot.inertia import about_origin
from robid.robot.regressor.links import COMPONENTS
from robid.robot.standard import StandardRobot, inertial_of, is_real, with_standard
from robid.settings.experiment import heaviest, payload_kg
from robid.settings.load import LoadedExperiment

_GROUP, _UNIT = "rigid/standard", "rigid/torque_unit"
_NEWTON_METRES = "N m"


@dataclass(frozen=True)
class Standard:
    """Standard parameters of real bodies as a fit of rigid dynamics found them."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    value: FloatArray  # (n_std,): the values
    covariance: FloatArray  # (n_std, n_std): their covariance by what was estimated
    status: str  # `estimated`, or `moved` where only the nearest real bodies could be had

    @property
    def values(self) -> dict[str, float]:
        """The values by name."""
        return dict(zip(self.names, self.value.tolist(), strict=True))

    def mean(self, joint: str, kind: str) -> tuple[float, float]:
        """Returns a joint's friction, the mean of both directions where they differ, and its deviation."""
        wanted = (f"{joint}.{kind}", f"{joint}.{kind}_forward", f"{joint}.{kind}_backward")
        own = np.isin(np.array(self.names), wanted)
        share = own / max(1, own.sum())
        return float(share @ self.value), float(np.sqrt(share @ self.covariance @ share))


def standard_from_artifact(model: Artifact, fit: str) -> Standard:
    """Reads the standard parameters from the model of a rigid fit.

    Raises:
        DataError: If it has none that could be handed on.
    """
    unit = str(model.attributes.get(_UNIT, _NEWTON_METRES))
    if unit != _NEWTON_METRES:
        message = f"D161 fit `{fit}` knows torques in {unit} alone: its masses are ratios to the torque constant"
        raise DataError(message, where=f"fits.{fit}", remedy="import torques in N m; json, csv and mat hold the ratios")
    status = str(model.attributes.get(f"{_GROUP}/status", "missing"))
    if status not in ("estimated", "moved"):
        message = f"D162 fit `{fit}` has no standard parameters of real bodies ({status})"
        remedy = "leave `physical` at true, and give the robot file's links masses and inertias that a body can have"
        raise DataError(message, where=f"fits.{fit}", remedy=remedy)
    found = {key: model.datasets[f"{_GROUP}/{key}"].values for key in ("names", "units", "value", "covariance")}
    return Standard(
        names=tuple(map(str, found["names"])),
        units=tuple(map(str, found["units"])),
        value=np.asarray(found["value"], float),
        covariance=np.asarray(found["covariance"], float),
        status=status,
    )


def standard_robot(loaded: LoadedExperiment, fit: str, standard: Standard) -> StandardRobot:
    """Returns the robot file's robot with the standard parameters of a rigid fit, and with that fit's payload."""
    campaign = loaded.experiment.campaigns[heaviest(loaded.experiment, loaded.experiment.fits[fit], loaded.robot)]
    found = with_standard(loaded.robot.to_robot(campaign.payload_kg), standard.values)
    return replace(found, robot=_with_std(found.robot, standard))


def _with_std(robot: Robot, standard: Standard) -> Robot:
    joints = []
    for joint in robot.joints:
        law, (level, std) = joint.motor.friction, standard.mean(joint.name, "coulomb")
        friction = replace(law, relative_std=std / level) if level > 0 else law
        joints.append(replace(joint, motor=replace(joint.motor, friction=friction)))
    return replace(robot, joints=tuple(joints))


_RIGID = (*COMPONENTS, "motor_inertia", "viscous", "viscous_forward", "viscous_backward")
_SHARE = 0.99  # of the variance that counts
_STEPS = (0.1, -0.1, 0.01, -0.01, 1e-3, -1e-3)  # deviations


@dataclass(frozen=True)
class RigidSource:
    """Standard parameters of a rigid fit, Coulomb friction left out: that belongs to the torques."""

    loaded: LoadedExperiment
    fit: str  # name of the rigid fit
    standard: Standard  # what it found
    payload_kg: float  # the payload that it was fitted with [kg]

    def robot(self, payload: float) -> Robot:
        """Returns the robot file's robot with what the fit found, and with a payload as campaigns state it [kg].

        A payload that the fit found by itself has the mass that it found, and for another one its share of that.

        Raises:
            DataError: If the payload is another one than the fit's, which cannot be told from the last link.
        """
        return self._robot(self.standard.values, payload)

    def perturbed(self, payload: float) -> list[tuple[Robot, float]]:
        """Returns robots that are off along the directions that hold most of the variance, and by how much.

        Directions are independent; by how many standard deviations a robot is off along its own is such that its
        bodies stay real.
        """
        found: list[tuple[Robot, float]] = []
        for direction in self.directions():
            for deviations in _STEPS:
                off = self.standard.value + deviations * direction
                moved = dict(zip(self.standard.names, off.tolist(), strict=True))
                if all(is_real(body) for body in _bodies(moved)):
                    found.append((self._robot(moved, payload), deviations))
                    break
        return found

    def directions(self) -> list[FloatArray]:
        """Returns independent errors (n_std,) of one standard deviation each, the largest first.

        Inertias and moments are compared by the size of their body.
        """
        names, size = self.standard.names, _sizes(self.standard)
        size *= [name.rpartition(".")[2] in _RIGID for name in names]
        usual = np.where(size > 0, size, 1.0)
        scaled = self.standard.covariance / np.outer(usual, usual)
        scaled = np.where(np.outer(size > 0, size > 0), scaled, 0.0)
        variance, axes = np.linalg.eigh(scaled)
        order = np.argsort(variance)[::-1]
        total = np.cumsum(np.maximum(variance[order], 0.0))
        count = int(np.searchsorted(total, _SHARE * total[-1])) + 1 if total[-1] > 0 else 0
        return [usual * np.sqrt(variance[index]) * axes[:, index] for index in order[:count]]

    def _robot(self, values: Mapping[str, float], payload: float) -> Robot:
        file = self.loaded.robot
        rigid = {name: value for name, value in values.items() if name.rpartition(".")[2] in _RIGID}
        found = with_standard(file.to_robot(self.payload_kg), rigid)
        if found.payload_is_in_link:
            self._check_joined(found, payload)
            return found.robot
        if self.payload_kg == 0:
            return replace(found.robot, payload=file.to_robot(payload).payload)
        # A body of another mass and the same shape.
        body, factor = found.robot.payload, payload / self.payload_kg
        return replace(found.robot, payload=Inertial(factor * body.mass_kg, body.com_m, factor * body.inertia_kgm2))

    def _check_joined(self, found: StandardRobot, payload: float) -> None:
        hangs = any(spring.place == "payload" for spring in found.robot.springs)
        if hangs or payload != self.payload_kg:
            message = (
                f"D163 fit `{self.fit}` found a last link and payload that leave no real body without the robot file's"
                f" payload of {self.payload_kg:g} kg, but it is needed apart from the link"
            )
            remedy = "identify the payload (`model: {payload: body}`), or correct the robot file's"
            raise DataError(message, where=f"fits.{self.fit}", remedy=remedy)


def rigid_source(loaded: LoadedExperiment, fit: str, model: Artifact) -> RigidSource:
    """Reads what a rigid fit hands on.

    Raises:
        DataError: If it has no standard parameters of real bodies.
    """
    experiment = loaded.experiment
    campaign = experiment.campaigns[heaviest(experiment, experiment.fits[fit], loaded.robot)]
    return RigidSource(loaded, fit, standard_from_artifact(model, fit), payload_kg(campaign, loaded.robot))


def _bodies(values: Mapping[str, float]) -> list[Inertial]:
    owners = [name.removesuffix(".M") for name in values if name.endswith(".M")]
    return [inertial_of(np.array([values[f"{owner}.{one}"] for one in COMPONENTS])) for owner in owners]


def _sizes(standard: Standard) -> FloatArray:
    """What errors (n_std,) are measured by: a body's mass and radius of gyration, else the value itself."""
    values, sizes = standard.values, dict(zip(standard.names, np.abs(standard.value).tolist(), strict=True))
    for owner in [name.removesuffix(".M") for name in values if name.endswith(".M")]:
        body = inertial_of(np.array([values[f"{owner}.{one}"] for one in COMPONENTS]))
        radius = float(np.sqrt(0.5 * np.trace(about_origin(body)) / body.mass_kg))
        scale = body.mass_kg * np.repeat([radius**2, radius, 1.0], [6, 3, 1])
        sizes |= {f"{owner}.{one}": float(own) for one, own in zip(COMPONENTS, scale, strict=True)}
    return np.array([sizes[name] for name in standard.names])


@dataclass(frozen=True)
class MotorFriction:
    """Friction of some motors, motor side; where it differs between the directions the mean of both."""

    coulomb_nm: FloatArray  # (n_joint,): coulomb levels [N m]
    coulomb_std: FloatArray  # (n_joint,): their standard deviations [N m]
    uneven_nms_rad: FloatArray  # (n_joint,): half of what viscous friction is larger forward than backward [N m s/rad]


def friction_from_artifact(model: Artifact, fit: str, joints: Sequence[str], torque_unit: str = "N m") -> MotorFriction:
    """Reads motor friction from the model of a fit, in the unit of the torques that it is subtracted from.

    Raises:
        DataError: If it knows no friction of a motor, or torques in another unit.
    """
    unit = str(model.attributes.get(_UNIT, _NEWTON_METRES))
    if unit != torque_unit:
        message = f"D164 fit `{fit}` knows friction in {unit}, but it is subtracted from torques in {torque_unit}"
        raise DataError(message, where=f"fits.{fit}", remedy="import both logs in the same unit")
    estimate = estimate_from_artifact(model)
    rows = [_weights(estimate, joint, "coulomb") for joint in joints]
    missing = [joint for joint, row in zip(joints, rows, strict=True) if not row.any()]
    if missing:
        message = f"D165 fit `{fit}` found no Coulomb friction of {', '.join(missing)}"
        raise DataError(message, where=f"fits.{fit}", remedy="record a motion that reverses these motors often")
    mean = np.array(rows)
    uneven = np.array([_weights(estimate, joint, "viscous", opposite=-1.0) for joint in joints])
    return MotorFriction(
        coulomb_nm=mean @ estimate.value,
        coulomb_std=np.sqrt(np.einsum("jp,pq,jq->j", mean, estimate.covariance, mean)),
        uneven_nms_rad=uneven @ estimate.value,
    )


def _weights(estimate: Estimate, joint: str, kind: str, opposite: float = 1.0) -> FloatArray:
    """Weights (n_param,) of the parameters in a mean of both directions, or, with -1, in half their difference."""
    one_way = {f"{joint}.{kind}_forward": 0.5, f"{joint}.{kind}_backward": 0.5 * opposite}
    both = {} if opposite < 0 else {f"{joint}.{kind}": 1.0}
    return np.array([{**one_way, **both}.get(name, 0.0) for name in estimate.names])


def gears_of(estimate: Estimate, fit: str, robot: Robot, torque_unit: str = "N m") -> dict[str, KnownGear]:
    """Returns the gears of a robot that a fit has identified, by the name of their spring.

    Raises:
        DataError: If it has identified none of this robot, or torques are in a unit of their own.
    """
    if torque_unit != _NEWTON_METRES:
        message = f"D652 fit `{fit}` knows gears in N m/rad, but the response has torques in {torque_unit}"
        raise DataError(message, where=f"fits.{fit}", remedy="state the torque constants of the response's log")
    joints = {each.name: robot.joints[each.joint].name for each in robot.springs if each.place == "transmission"}
    found = {name: gear for name, gear in known_gears(estimate, joints).items() if name in joints}
    if not found:
        message = f"D651 fit `{fit}` identified the stiffness of no gear of {robot.name}"
        remedy = "record motions that load the gears (see its page), or leave out `springs_from`"
        raise DataError(message, where=f"fits.{fit}", remedy=remedy)
    return found
