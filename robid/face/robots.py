"""A robot file in memory: its elastic model, and the model's response in any configuration."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from robid.arrays import ComplexArray, FloatArray
from robid.face.arguments import kind_of, placed, sampled, shaped, wrong_type
from robid.face.parameters import Parameters
from robid.models.elastic.fit.solution import fitted_robot
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response

if TYPE_CHECKING:
    from robid.face.fits import Fit
    from robid.face.runs import StoredFit
    from robid.frf.frf import Frf
    from robid.robot.description import Robot
    from robid.signals.quantities import Rate

_ELASTIC, _DELAY = "elastic", "delay"


@dataclass(frozen=True)
class RobotModel:
    """A robot with springs and dampers between its motors and links."""

    description: Robot  # Geometry, masses, drives, springs, friction and payload, as plain values
    sampling_period_s: float | None = None  # Of its controller, which holds torques; None where the file has none
    delay_s: float = 0.0  # From the computed to the applied torque, hold excluded [s]
    held: bool = True  # Whether torques are held for a sampling period; else they were measured like the motions
    # How many times each motor's motion is differentiated before it is sampled, see `robid.signals.quantities.Rate`;
    # empty for positions
    rates: tuple[Rate, ...] = ()

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self.description.name

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of its joints, from the base outwards."""
        return tuple(joint.name for joint in self.description.joints)

    @property
    def lower(self) -> FloatArray:
        """Lower limits (n_joint,) of the joints [rad, or m]."""
        return self.description.lower

    @property
    def upper(self) -> FloatArray:
        """Upper limits (n_joint,) of the joints [rad, or m]."""
        return self.description.upper

    def response(
        self, configurations: FloatArray, frequency_hz: FloatArray, *, continuous: bool = False
    ) -> ComplexArray:
        """Computes responses from motor torques to motor accelerations, where gravity lets the robot rest.

        Args:
            configurations (n_conf, n_joint): Arm-side joint positions [rad, or m]; one alone is (1, n_joint).
            frequency_hz (n_freq,): Frequencies [Hz].
            continuous: Whether torques act without hold and delay; else as the controller applies them, or as in the
                data of the fit that was put in.

        Returns:
            Responses (n_conf, n_freq, n_motor, n_motor), rad/s^2 per N m.

        Raises:
            SettingsError: If an argument has another shape, or a frequency is none that a sampled signal has.
            DataError: If springs give way under gravity.

        Source:
            docs/methods, sec. 1.
        """
        called = "RobotModel.response"
        places = shaped(configurations, "configurations", "n_conf n_joint", called, n_joint=len(self.joints))
        places = placed(places, "configurations", called)
        lines = sampled(frequency_hz, called, None if continuous else self.sampling_period_s)
        model = build_model(self.description)
        linear = replace(linearize(model, solve_statics(model, places)), rates=self.rates)
        parameters = nominal_parameters(model.robot, linear, 0.0 if continuous else self.delay_s)
        period_s = self.sampling_period_s if self.held and not continuous else None
        return response(linear, parameters, lines, period_s).sampled

    def with_fit(self, fit: Fit | StoredFit | Parameters) -> RobotModel:
        """Returns the robot with an elastic fit's values in place; what was not estimated stays as it is.

        Sampling period, hold and delay become those of the fit and its data; those of parameters alone are not known.

        Raises:
            SettingsError: If it is no fit, or one of another kind of model.
        """
        parameters = fit if isinstance(fit, Parameters) else getattr(fit, "parameters", None)
        kind = getattr(fit, "kind", _ELASTIC)
        if parameters is None or kind != _ELASTIC:
            given = kind_of(fit) if parameters is None else f"a fit of the kind {kind}"
            what = f"`fit` is {given}, but must be an elastic fit, or its parameters"
            raise wrong_type(what, "RobotModel.with_fit", "give `run.fits[name]` or what `fit_model` returns")
        found = replace(self, description=fitted_robot(self.description, parameters.estimate))
        if _DELAY in parameters:
            found = replace(found, delay_s=parameters[_DELAY].value)
        data: Frf | None = getattr(fit, "responses", None)
        if data is None:
            return found
        rates = data.output_rates if data.output_names == self.joints else ()
        return replace(found, sampling_period_s=data.sampling_period_s, held=data.input_hold == "zoh", rates=rates)

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
