"""The masses, inertias and viscous friction of a rigid fit as robots: what it found, and how far that may be off."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Artifact
from robid.errors import DataError
from robid.models.standard import Standard, standard_from_artifact
from robid.robot.description import Inertial, Robot
from robid.robot.inertia import about_origin
from robid.robot.regressor.links import COMPONENTS
from robid.robot.standard import StandardRobot, inertial_of, is_real, with_standard
from robid.settings.experiment import heaviest, payload_kg
from robid.settings.load import LoadedExperiment

_RIGID = (*COMPONENTS, "motor_inertia", "viscous", "viscous_forward", "viscous_backward")
_SHARE = 0.99  # of the variance that counts
_STEPS = (0.1, -0.1, 0.01, -0.01, 1e-3, -1e-3)  # deviations


@dataclass(frozen=True)
class RigidSource:
    """Standard parameters of a rigid fit, Coulomb friction left out: that belongs to the torques.

    Attributes:
        loaded: The experiment.
        fit: Name of the rigid fit.
        standard: What it found.
        payload_kg: The payload that it was fitted with [kg].
    """

    loaded: LoadedExperiment
    fit: str
    standard: Standard
    payload_kg: float

    def robot(self, payload: float) -> Robot:
        """Returns the robot file's robot with what the fit found, and with a payload as campaigns state it [kg].

        A payload that the fit found by itself has the mass that it found, and for another one its share of that.

        Raises:
            DataError: If the payload is another one than the fit's, which cannot be told from the last link.
        """
        return self._robot(self.standard.values, payload)

    def doubtful(self, payload: float) -> list[tuple[Robot, float]]:
        """Returns robots that are off along the few directions that hold most of the variance, and by how much.

        Directions are independent; by how many standard deviations a robot is off along its own is such that its
        bodies stay real.

        Args:
            payload: The payload [kg].
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
        return replace(found.robot, payload=_scaled(found.robot.payload, payload / self.payload_kg))

    def _check_joined(self, found: StandardRobot, payload: float) -> None:
        hangs = any(spring.place == "payload" for spring in found.robot.springs)
        if hangs or payload != self.payload_kg:
            message = (
                f"fit `{self.fit}` found a last link and payload that leave no real body without the robot file's"
                f" payload of {self.payload_kg:g} kg, but it is needed apart from the link"
            )
            remedy = "identify the payload (`model: {payload: body}`), or correct the robot file's"
            raise DataError(message, where=f"fits.{self.fit}", remedy=remedy)


def rigid_source(loaded: LoadedExperiment, fit: str, model: Artifact) -> RigidSource:
    """Reads what a rigid fit hands on.

    Args:
        loaded: The experiment.
        fit: Name of the rigid fit.
        model: Its artifact.

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


def _scaled(body: Inertial, factor: float) -> Inertial:
    """A body of another mass and the same shape."""
    return Inertial(factor * body.mass_kg, body.com_m, factor * body.inertia_kgm2)
