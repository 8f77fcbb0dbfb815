"""A family that robid does not know: the inertia that each motor's torque moves, from records alone."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Literal

import numpy as np
import pydantic.dataclasses
from pydantic import Field

from robid.artifacts.artifact import Artifact, Dataset
from robid.artifacts.results import estimate_from_artifact, model_to_artifact, validation_to_artifact
from robid.models.family import Data, Export, ExportTask, Family, Shown, Work
from robid.models.parameters import parameter_rows, parameter_summary
from robid.report.page import FitReport, Headline, KeyNumber
from robid.report.section import Section, Table
from robid.results.estimate import Estimate
from robid.results.grade import grade_alone, grade_held
from robid.results.outcome import Outcome, recover
from robid.settings.fits import STRICT, FitSettings
from robid.signals.record import Record


@pydantic.dataclasses.dataclass(frozen=True, kw_only=True, config=STRICT)
class InertiaFit(FitSettings):
    """A fit of one inertia a motor."""

    family: Literal["inertia"] = Field(description="Family of the model.")
    shrink: float = Field(default=0.0, description="Share by which estimates are pulled to zero.", ge=0)


def _torque_and_acceleration(record: Record):
    lines, n_motor = record.excited_lines, len(record.input_names)
    omega = 2 * np.pi * record.frequency_hz[:, None]
    torque, angle = (np.fft.rfft(x[..., :n_motor], axis=4)[..., lines, :] for x in (record.inputs, record.outputs))
    return torque.reshape(-1, n_motor), (-(omega**2) * angle).reshape(-1, n_motor)


def _fit(data: Data, work: Work) -> Artifact:
    settings = data.settings
    assert isinstance(settings, InertiaFit)
    work.progress.expect(1, "records")
    torque, acceleration = _torque_and_acceleration(data.records[0])
    power = np.sum(np.abs(acceleration) ** 2, axis=0)
    estimate = np.sum((acceleration.conj() * torque).real, axis=0) / power * (1 - settings.shrink)
    spread = np.sqrt(np.mean(np.abs(torque - estimate * acceleration) ** 2, axis=0) / power)
    n_motor = estimate.size
    found = Estimate(
        names=tuple(f"{name}.motor_inertia" for name in data.records[0].input_names),
        kinds=("motor_inertia",) * n_motor,
        units=("kg m^2",) * n_motor,
        nominal=np.zeros(n_motor),
        value=estimate,
        lower=estimate - 2 * spread,
        upper=estimate + 2 * spread,
        covariance=np.diag(spread**2),
        degrees_of_freedom=np.full(n_motor, np.inf),
        confidence=0.95,
        interval_rule="noise",
        relative_std=spread / estimate,
        predicted_relative_std=spread / estimate,
        prior_relative_std=np.full(n_motor, np.inf),
        relative_half_width=2 * spread / estimate,
        identifiable=np.ones(n_motor, bool),
        identifiable_relative_std=0.2,
        undetermined=(),
        status="converged",
        advice="",
    )
    own = {"inertia/spread": Dataset(spread, "kg m^2", ("parameter",))}
    return model_to_artifact("inertia", found, grade_alone((), ("it is a toy",), ()), (own, {}))


def _validate(data: Data, model: Artifact, true) -> Artifact:
    torque, acceleration = _torque_and_acceleration(data.records[0])
    found = estimate_from_artifact(model)
    error = np.sqrt((np.abs(torque - found.value * acceleration) ** 2).mean(axis=0))
    recovery = recover(found, true_values(true) if true else {})
    outcome = Outcome(True, "holds", grade_held((), ("it is a toy",), ()), recovery)
    return validation_to_artifact("inertia", outcome, ({"inertia/error": Dataset(error, "N m", ("parameter",))}, {}))


def true_values(true):
    return {f"{joint.name}.motor_inertia": joint.motor.inertia_kgm2 for joint in true.robot.joints}


def _report(shown: Shown) -> FitReport:
    rows = parameter_rows(estimate_from_artifact(shown.model), shown.true)
    table = Table(("motor", "inertia"), tuple((row.name, f"{row.estimate:.3g}") for row in rows))
    summary = parameter_summary(rows) | {"validated": float(shown.validation is not None)}
    headline = Headline(shown.data.name, (KeyNumber("Motors", str(len(rows))),), status="converged")
    section = Section("What the motors move", "One number a motor.", (table,), "inertia")
    return FitReport(headline, "Every motor moves something.", 1, (section,), rows, summary)


def _problems(experiment, name, _robot) -> Iterator:
    if experiment.fits[name].shrink > 1:
        yield ("shrink",), "nothing would be left of the estimates"


def _json(task: ExportTask) -> bytes:
    return json.dumps(estimate_from_artifact(task.model).found).encode()


INERTIA = Family(
    name="inertia",
    settings=InertiaFit,
    reads=("record",),
    problems=_problems,
    decides=lambda _loaded, campaign: {f"campaigns.{campaign}.payload_kg": None},
    fit=_fit,
    validate=_validate,
    seed=lambda _: None,
    true_values=lambda _loaded, _name, true: true_values(true),
    phrase=lambda model: f"{len(estimate_from_artifact(model).names)} inertias",
    verdict=lambda validation: f"off by {validation.datasets['inertia/error'].values.max():.3g} N m",
    report=_report,
    compare=lambda every: {"inertia.fits": float(len(every))},
    exports={"json": Export("inertia.json", (".json",), _json, takes_configuration=False)},
)
