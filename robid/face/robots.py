"""A robot file in memory: its elastic model, and the model's response in any configuration."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from robid.arrays import ComplexArray, FloatArray, check_shape
from robid.face.parameters import Parameters
from robid.models.elastic.fit.solution import fitted_robot
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response

if TYPE_CHECKING:
    from robid.face.fits import Fit
    from robid.face.runs import StoredFit
    from robid.robot.description import Robot


@dataclass(frozen=True)
class RobotModel:
    """A robot with springs and dampers between its motors and links."""

    description: Robot  # Geometry, masses, drives, springs, friction and payload, as plain values
    sampling_period_s: float | None = None  # Of its controller, which holds torques; None where the file has none
    delay_s: float = 0.0  # From the computed to the applied torque, hold excluded [s]

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self.description.name

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of its joints, from the base outwards."""
        return tuple(joint.name for joint in self.description.joints)

    def response(
        self, configurations: FloatArray, frequency_hz: FloatArray, *, continuous: bool = False
    ) -> ComplexArray:
        """Computes responses from motor torques to motor accelerations, where gravity lets the robot rest.

        Args:
            configurations (n_conf, n_joint): Arm-side joint positions [rad, or m]; one alone is (1, n_joint).
            frequency_hz (n_freq,): Frequencies [Hz].
            continuous: Whether torques act without hold and delay; else as the controller applies them.

        Returns:
            Responses (n_conf, n_freq, n_motor, n_motor), rad/s^2 per N m.

        Raises:
            ValueError: If an argument has another shape.
            DataError: If springs give way under gravity.

        Source:
            docs/methods, sec. 1.
        """
        places, lines = np.asarray(configurations, float), np.asarray(frequency_hz, float)
        check_shape("configurations", places, "n_conf n_joint", n_joint=len(self.joints))
        check_shape("frequency_hz", lines, "n_freq")
        model = build_model(self.description)
        linear = linearize(model, solve_statics(model, places))
        parameters = nominal_parameters(model.robot, linear, 0.0 if continuous else self.delay_s)
        return response(linear, parameters, lines, None if continuous else self.sampling_period_s).sampled

    def with_fit(self, fit: Fit | StoredFit | Parameters) -> RobotModel:
        """Returns the robot with an elastic fit's values in place; what was not estimated stays as it is."""
        parameters = fit if isinstance(fit, Parameters) else fit.parameters
        return replace(self, description=fitted_robot(self.description, parameters.estimate))

    def __repr__(self) -> str:
        springs = ", ".join(spring.name for spring in self.description.springs)
        return f"robot {self.name}: joints {', '.join(self.joints)}; springs {springs}"


def load_robot(path: str | Path, payload_kg: float | None = None) -> RobotModel:
    """Loads a robot file.

    Args:
        path: The robot file, as `configs/robots/kr300.yaml`.
        payload_kg: Another payload mass than the file's [kg].

    Raises:
        SettingsError: With every problem of the file, each with its line and field.
    """
    from robid.settings.load import load_robot as load_file

    file = load_file(Path(path))
    controller = file.controller
    period = None if controller is None else controller.sampling_period_s
    delay = 0.0 if controller is None else controller.delay_samples * controller.sampling_period_s
    return RobotModel(file.to_robot(payload_kg), period, delay)
