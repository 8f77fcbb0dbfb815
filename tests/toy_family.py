"""A family that robid does not know: the inertia that each motor's torque moves, from records alone."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Literal

import numpy as np
import pydantic.dataclasses
from pydantic import Field

from robid.artifacts.artifact import Artifact, Dataset, Provenance
from robid.artifacts.model import MODEL
from robid.artifacts.validation import VALIDATION
from robid.families.family import Data, Export, ExportTask, Family, Shown, Work
from robid.report.content import FitReport, Headline, KeyNumber
from robid.report.parameters import ParameterRow
from robid.report.section import Section, Table
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
    names = np.array([f"{name}.inertia" for name in data.records[0].input_names])
    datasets = {
        "names": Dataset(names, "1", ("parameter",)),
        "estimate": Dataset(estimate, "kg m^2", ("parameter",)),
        "spread": Dataset(spread, "kg m^2", ("parameter",)),
    }
    told = {"status": "converged", "advice": "", "grade/value": 1, "grade/sentence": "Predicts: it is a toy."}
    return Artifact(MODEL, datasets, {"family": "inertia", **told}, Provenance(stage="fit"))


def _validate(data: Data, model: Artifact, true) -> Artifact:
    torque, acceleration = _torque_and_acceleration(data.records[0])
    error = np.abs(torque - model.datasets["estimate"].values * acceleration) ** 2
    datasets = {"error": Dataset(np.sqrt(error.mean(axis=0)), "N m", ("parameter",))}
    told = {"grade/value": 1, "grade/sentence": "Predicts: it is a toy.", "known": true is not None}
    return Artifact(VALIDATION, datasets, told, Provenance(stage="validate"))


def _report(shown: Shown) -> FitReport:
    names = shown.model.datasets["names"].values.tolist()
    found, spread = (shown.model.datasets[key].values.tolist() for key in ("estimate", "spread"))
    rows = tuple(
        ParameterRow(name.removesuffix(".inertia"), "inertia", "kg m^2", 0.0, x, x - 2 * s, x + 2 * s, s / x)
        for name, x, s in zip(names, found, spread, strict=True)
    )
    table = Table(("motor", "inertia"), tuple((row.name, f"{row.estimate:.3g}") for row in rows))
    summary = {f"inertia.{row.name}": row.estimate for row in rows} | {"validated": float(shown.validation is not None)}
    headline = Headline(shown.data.name, (KeyNumber("Motors", str(len(rows))),), status="converged")
    section = Section("What the motors move", "One number a motor.", (table,), "inertia")
    return FitReport(headline, "Every motor moves something.", 1, (section,), rows, summary)


def _problems(experiment, name, _robot) -> Iterator:
    if experiment.fits[name].shrink > 1:
        yield ("shrink",), "nothing would be left of the estimates"


def _json(task: ExportTask) -> bytes:
    names, values = (task.model.datasets[key].values.tolist() for key in ("names", "estimate"))
    return json.dumps(dict(zip(names, values, strict=True))).encode()


INERTIA = Family(
    name="inertia",
    settings=InertiaFit,
    reads=("record",),
    problems=_problems,
    decides=lambda _loaded, campaign: {f"campaigns.{campaign}.payload_kg": None},
    fit=_fit,
    validate=_validate,
    seed=lambda _: None,
    true_values=lambda *_: {},
    phrase=lambda model: f"{model.datasets['estimate'].values.size} inertias",
    verdict=lambda validation: f"off by {validation.datasets['error'].values.max():.3g} N m",
    report=_report,
    compare=lambda every: {"inertia.fits": float(len(every))},
    exports={"json": Export("inertia.json", (".json",), _json, takes_configuration=False)},
)
