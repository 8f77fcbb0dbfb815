"""Outputs of a simulation beyond its motors: link encoders and sensors of the tool."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mujoco.batch import Batch

from robid.arrays import FloatArray
from robid.robot.description import Robot
from robid.robot.model import ElasticModel
from robid.signals.quantities import Channel, QuantityName, Side
from robid.simulate.link_encoders import LinkEncoders
from robid.simulate.options import Imperfections


def further_channels(robot: Robot, names: Sequence[str]) -> tuple[Channel, ...]:
    """Returns what outputs beyond the motors are: arm angles, and the tool's positions and accelerations."""
    kinds: dict[str, str] = {sensor.name: sensor.kind for sensor in robot.sensors}
    sliding = zip(robot.joints, robot.prismatic.tolist(), strict=True)
    kinds |= {f"{joint.name}.arm": "slide" for joint, slides in sliding if slides}
    known: dict[str, tuple[QuantityName, str, Side]] = {
        "link_encoder": ("angle", "rad", "arm"),
        "slide": ("position", "m", "arm"),
        "tracker": ("position", "m", "tool"),
        "accelerometer": ("acceleration", "m/s^2", "tool"),
    }
    return tuple(Channel(name, *known[kinds.get(name, "link_encoder")]) for name in names)


class FurtherOutputs:
    """Reads link encoders and sensors of many simulations, one row each.

    Args:
        model: The elastic model, built with sensors where `names` has any.
        batch: The simulations.
        names: `<joint>.arm` and names of sensors.
        flaws: What of them is not exact.
        period_s: Sampling period [s].
    """

    def __init__(
        self, model: ElasticModel, batch: Batch, names: tuple[str, ...], flaws: Imperfections, period_s: float
    ) -> None:
        joints = [joint.name for joint in model.robot.joints]
        sensors = {sensor.name: sensor for sensor in model.robot.sensors}
        self._n_sim, self._n = batch.nsim, len(names)
        self._arms = [column for column, name in enumerate(names) if name not in sensors]
        encoded = [joints.index(names[column].removesuffix(".arm")) for column in self._arms]
        self._encoders = LinkEncoders(model, batch, encoded, flaws, period_s)
        self._sensed = [column for column, name in enumerate(names) if name in sensors]
        self._axes = np.zeros((model.mujoco.nsensordata, len(self._sensed)))
        for position, column in enumerate(self._sensed):
            start = int(model.mujoco.sensor(names[column]).adr[0])
            self._axes[start : start + 3, position] = sensors[names[column]].axis
        self._data = batch.sensordata if self._sensed else None
        slides = dict(zip(joints, model.robot.prismatic.tolist(), strict=True))
        self._kinds = [
            sensors[name].kind if name in sensors
            else "linear_encoder" if slides[name.removesuffix(".arm")]
            else "link_encoder"
            for name in names
        ]  # fmt: skip

    def noise_std(self, flaws: Imperfections) -> FloatArray:
        """Returns the standard deviation (n_out,) of each output's noise, in its unit."""
        known = {
            "link_encoder": flaws.link_encoder_noise_rad,
            "linear_encoder": flaws.link_encoder_noise_m,
            "tracker": flaws.tracker_noise_m,
            "accelerometer": flaws.accelerometer_noise_m_s2,
        }
        return np.array([known[kind] for kind in self._kinds])

    def resolution(self, flaws: Imperfections) -> FloatArray:
        """Returns the step (n_out,) in which each output is shown, in its unit; 0 where it is shown as it is."""
        known = {"link_encoder": flaws.link_encoder_resolution_rad, "linear_encoder": flaws.link_encoder_resolution_m}
        return np.array([known.get(kind, 0.0) for kind in self._kinds])

    def begin(self) -> None:
        """Begins where the batch is."""
        self._encoders.begin()

    def arms(self) -> FloatArray:
        """Returns what the link encoders show (n_sim, n_arm) now, once a sample [rad, or m]."""
        return self._encoders.read()

    def read(self, arms: FloatArray | None = None) -> FloatArray:
        """Returns all outputs (n_sim, n_out); sensors as the engine computed them last [rad, m or m/s^2].

        Args:
            arms (n_sim, n_arm): What the link encoders show at that time; where the arms are when not given [rad].
        """
        values = np.empty((self._n_sim, self._n))
        values[:, self._arms] = self._encoders.true() if arms is None else arms
        if self._data is not None:
            values[:, self._sensed] = self._data @ self._axes
        return values
