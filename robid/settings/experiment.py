"""Models of the experiment file."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, Union

import numpy as np
import pydantic.dataclasses
from pydantic import ConfigDict, Field, create_model, model_validator

from robid.design.excitation_options import MultisineOptions
from robid.design.options import CostOptions, DesignOptions, InformationOptions
from robid.frf.options import EstimateOptions
from robid.settings.base import DATA_VARIABLE, Name, Section, data_path
from robid.settings.excitation import ExcitationSettings
from robid.settings.fits import STRICT, Families, FitSettings, part
from robid.settings.study import Study
from robid.settings.truth import SimulateSettings

Rows = Annotated[tuple[Annotated[tuple[float, ...], Field(min_length=1)], ...], Field(min_length=1)]
_ONE_KEY = ConfigDict(json_schema_extra={"minProperties": 1, "maxProperties": 1})


class OneKey(Section):
    """A choice among sections that is made by writing exactly one of the keys."""

    model_config = _ONE_KEY

    @model_validator(mode="after")
    def _has_one_key(self) -> OneKey:
        if len(self.model_fields_set) != 1 or getattr(self, next(iter(self.model_fields_set))) is None:
            keys = [info.alias or name for name, info in type(self).model_fields.items()]
            message = f"needs exactly one of {', '.join(f'`{key}`' for key in keys)}"
            raise ValueError(message)
        return self


class RandomConfigurations(Section):
    """Robot configurations drawn uniformly within the joint limits; what is out of reach is drawn again."""

    count: int = Field(description="Number of configurations.", ge=1)
    seed: int = Field(default=1, description="Seed of the draw.", ge=0)
    margin_deg: float = Field(default=10.0, description="Distance kept from the joint limits [deg].", ge=0)
    margin_m: float = Field(default=0.05, description="The same of prismatic joints [m].", ge=0)


class Configurations(OneKey):
    """The robot configurations of a campaign; exactly one of the keys."""

    list_deg: Rows | None = Field(default=None, description="Joint angles, one row per configuration [deg].")
    positions: Rows | None = Field(
        default=None,
        alias="list",
        description="In place of `list_deg` where joints are prismatic: angles [deg] and positions [m].",
    )
    random: RandomConfigurations | None = Field(default=None, description="Drawn within the joint limits.")
    grid_deg: Rows | None = Field(
        default=None, description="Angles of each joint, one row per joint; every combination is measured [deg]."
    )
    grid: Rows | None = Field(
        default=None, description="In place of `grid_deg` where joints are prismatic: angles [deg] and positions [m]."
    )
    chosen_by: Name | Annotated[tuple[Name, ...], Field(min_length=1)] | None = Field(
        default=None, alias="from", description="Name of the design that chooses them, or of several in a row."
    )
    mirror: Name | None = Field(
        default=None,
        description="Name of a design whose choice is mirrored at the vertical plane through the world's x axis.",
    )
    join: tuple[Configurations, ...] | None = Field(
        default=None, description="Several such sections in a row.", min_length=1
    )

    @property
    def key(self) -> str:
        """The key that is written."""
        name = next(iter(self.model_fields_set))
        return type(self).model_fields[name].alias or name

    @property
    def list_rows(self) -> Rows | None:
        """Listed positions, one row per configuration [deg, or m]."""
        return self.list_deg if self.positions is None else self.positions

    @property
    def grid_rows(self) -> Rows | None:
        """Positions of each joint, one row per joint [deg, or m]."""
        return self.grid_deg if self.grid is None else self.grid

    @property
    def designs(self) -> tuple[str, ...]:
        """Names of the designs that must be there first, each once."""
        own = (self.chosen_by,) if isinstance(self.chosen_by, str) else self.chosen_by or ()
        mirrored = () if self.mirror is None else (self.mirror,)
        joined = (name for part in self.join or () for name in part.designs)
        return tuple(dict.fromkeys((*own, *mirrored, *joined)))


class TimeChannel(Section):
    """The log's own time, against which the sampling period is checked."""

    variable: str = Field(description="Name of the variable in the log.")
    unit: Literal["s", "ms", "us"] = Field(default="s", description="Unit of the time.")


class InputChannel(Section):
    """A motor torque, or the current that stands for it."""

    name: Name = Field(description="Name of the channel: that of the joint whose motor it drives.")
    variable: str = Field(description="Name of the variable in the log.")
    unit: Literal["N m", "A"] = Field(default="N m", description="Unit in the log.")
    torque_constant_nm_a: float | None = Field(
        default=None, description="Torque constant K_t of a current; 1 with `normalised` [N m/A].", gt=0
    )
    torque_constant_relative_std: float = Field(
        default=0.0, description="Relative standard deviation of the torque constant.", ge=0
    )
    normalised: bool = Field(
        default=False, description="The current stands for the torque: every result is a ratio to K_t."
    )
    sign: Literal[1, -1] = Field(default=1, description="Sign that turns the log's direction into the joint's.")
    scale: float = Field(default=1.0, description="Factor from the log's numbers to the unit.", gt=0)
    hold: Literal["zoh", "band_limited"] = Field(
        default="zoh", description="A command held for a sample, or measured like the angles."
    )

    @model_validator(mode="after")
    def _torque_is_known(self) -> InputChannel:
        if self.unit == "A" and self.torque_constant_nm_a is None:
            message = "a current needs `torque_constant_nm_a` (1 together with `normalised: true` where it is unknown)"
            raise ValueError(message)
        if self.unit == "N m" and (self.torque_constant_nm_a is not None or self.normalised):
            message = "a torque in N m takes neither `torque_constant_nm_a` nor `normalised`"
            raise ValueError(message)
        return self


class OutputChannel(Section):
    """A measured angle."""

    name: str = Field(
        description="Name of the channel: the joint's for its motor angle, `<joint>.arm` for its arm side.",
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*(\.arm)?$",
    )
    variable: str = Field(description="Name of the variable in the log.")
    unit: Literal["rad", "deg", "m", "mm"] = Field(
        default="rad", description="Unit in the log; of the arm side of a prismatic joint m or mm."
    )
    sign: Literal[1, -1] = Field(default=1, description="Sign that turns the log's direction into the joint's.")
    scale: float = Field(default=1.0, description="Factor from the log's numbers to the unit.", gt=0)


class ReferenceChannel(Section):
    """What a motor was told to do; it is matched to the excitation, which says where its periods begin."""

    name: Name = Field(description="Name of the joint.")
    variable: str = Field(description="Name of the variable in the log.")
    unit: Literal["rad/s", "deg/s", "rpm", "rad", "deg", "N m"] = Field(
        default="rad/s", description="Unit in the log, motor side; it belongs to `excitation.inject`."
    )
    sign: Literal[1, -1] = Field(default=1, description="Sign that turns the log's direction into the joint's.")
    scale: float = Field(default=1.0, description="Factor from the log's numbers to the unit.", gt=0)


class Acquire(Section):
    """Measured logs and what their variables mean."""

    file: str = Field(
        description="The log; `${ROBID_DATA}` stands for the data folder, other paths start at the experiment file;"
        " `{configuration}`, `{realization}` and `{experiment}` for their numbers, from 1."
    )
    format: Literal["mat", "csv"] = Field(description="Format of the log: MAT (version 5), or a table with a header.")
    sampling_period_s: float = Field(description="Sampling period of the log [s].", gt=0)
    drop_periods: int = Field(default=0, description="Periods dropped at the start of the log.", ge=0)
    take: Literal["first", "last"] = Field(
        default="first", description="Which whole periods are used: the first after those dropped, or the last."
    )
    time: TimeChannel | None = Field(default=None, description="The log's own time, if it has one.")
    inputs: tuple[InputChannel, ...] = Field(description="Motor torques, in the order of the joints.", min_length=1)
    outputs: tuple[OutputChannel, ...] = Field(description="Measured angles.", min_length=1)
    references: tuple[ReferenceChannel, ...] = Field(
        default=(),
        description="What the motors were told, in the order of the joints; the excitation is then designed here, and"
        " each log is matched to it.",
    )

    def log_path(self, folder: Path, configuration: int = 0, realization: int = 0, experiment: int = 0) -> Path:
        """Returns the path of a log.

        Args:
            folder: Folder of the experiment file, for a path that does not start with `${ROBID_DATA}`.
            configuration: Index of the configuration, from 0.
            realization: Index of the realization, from 0.
            experiment: Index of the experiment, from 0.
        """
        indices = {"configuration": configuration, "realization": realization, "experiment": experiment}
        rest = self.file.removeprefix(DATA_VARIABLE)
        start = self.file.removesuffix(rest) if rest else self.file
        return data_path(start + rest.format(**{key: index + 1 for key, index in indices.items()}), folder)

    def log_paths(self, folder: Path, *counts: int) -> tuple[Path, ...]:
        """Returns the paths of all logs, configuration by configuration, realization by realization.

        Args:
            folder: As in `log_path`.
            *counts: Number of configurations, realizations and experiments.
        """
        return tuple(self.log_path(folder, *indices) for indices in np.ndindex(*counts))


class Source(OneKey):
    """Where a campaign's record comes from; exactly one of the keys."""

    simulate: SimulateSettings | None = Field(default=None, description="Simulated in closed loop.")
    acquire: Acquire | None = Field(default=None, description="Imported from a log.")


class Campaign(Section):
    """One set of experiments in one set of robot configurations."""

    configurations: Configurations = Field(description="The robot configurations.")
    payload_kg: float | None = Field(
        default=None, description="Payload mass; the robot file's when not given [kg].", ge=0
    )
    excitation: ExcitationSettings = Field(
        default_factory=MultisineOptions, description="What the motors are told to do."
    )
    realizations: int = Field(default=1, description="Blocks of experiments with new random phases.", ge=1)
    experiments: int | None = Field(
        default=None,
        description="Experiments of each block; as many as motors when not given. Fewer need `estimate.estimator:"
        " local_periodic` and dense linear lines. On the simulated KR300 (195 odd lines, noise, no friction) the"
        " diagonal's error stays within 1.5x of the full block's with 2 of 6 experiments and `local_denominator: 2`;"
        " with 3 and a polynomial in a single realization; with 4 realizations, with 1, `local_order: 4` and"
        " `local_denominator: 2`.",
        ge=1,
    )
    periods: int = Field(default=2, description="Recorded periods of each experiment.", ge=1)
    outputs: tuple[str, ...] = Field(
        default=("motors",),
        description="What a simulation records: `motors` first, then `<joint>.arm` and the robot's `sensors`.",
    )
    source: Source | None = Field(default=None, description="Where the record comes from; none if never measured.")
    estimate: EstimateOptions = Field(
        default_factory=EstimateOptions, description="How the record becomes a frequency response."
    )

    @model_validator(mode="before")
    @classmethod
    def _logs_look_at_their_silent_lines(cls, values: Any) -> Any:  # noqa: ANN401
        """Compensates logs by `auto` unless told otherwise: nobody knows their friction's form beforehand."""
        if not isinstance(values, Mapping) or not isinstance(values.get("source"), Mapping):
            return values
        estimate = values.get("estimate", {})
        if "acquire" not in values["source"] or not isinstance(estimate, Mapping) or "compensation" in estimate:
            return values
        return {**values, "estimate": {**estimate, "compensation": "auto"}}


@pydantic.dataclasses.dataclass(frozen=True, kw_only=True, config=STRICT)
class Design(CostOptions, InformationOptions, DesignOptions):
    """A choice of robot configurations among those of a campaign."""

    campaign: Name = Field(description="Name of the campaign with the configurations to choose from.")
    prior: Name | None = Field(
        default=None,
        description="Name of an earlier fit: what it knows counts beforehand, and its estimates take the place of the"
        " robot file's values. The configuration that adds most to it comes first.",
    )
    fit: Name | None = Field(
        default=None,
        description="Name of the fit that the choice is for, with `weights: {mean: fit}`: its estimator and weights"
        " take the place of user weights with the design's `off_diagonal` and `low_cut_hz`.",
    )

    def options(self) -> DesignOptions:
        """Returns the options of the algorithm."""
        return part(self, DesignOptions)

    def about(self) -> InformationOptions:
        """Returns which information it is made by."""
        return part(self, InformationOptions)


class Execution(Section):
    """How the experiment is computed; nothing here changes a result."""

    backend: Literal["serial", "processes"] = Field(default="processes", description="How tasks are mapped to cores.")
    workers: int | None = Field(default=None, description="Number of processes; all cores when not given.", ge=1)
    log_level: Literal["info", "warning"] = Field(
        default="info", description="What is told while it runs: progress, messages and warnings, or warnings alone."
    )


class Experiment(Section):
    """An experiment file."""

    schema_version: Literal[1] = Field(description="Version of this format.")
    name: Name = Field(description="Name of the experiment and of its run folder.")
    robot: str = Field(description="The robot file, relative to this file.", min_length=1)
    campaigns: dict[Name, Campaign] = Field(description="Campaigns by name.", min_length=1)
    designs: dict[Name, Design] = Field(default_factory=dict, description="Choices of configurations by name.")
    fits: dict[Name, FitSettings] = Field(default_factory=dict, description="Fits by name.")
    study: Study | None = Field(default=None, description="What `robid study` does beyond the campaigns and fits.")
    execution: Execution = Field(default_factory=Execution, description="How it is computed.")


def experiment_type(families: Families) -> type[Experiment]:
    """Returns the type of an experiment file whose fits are of these families."""
    return _experiment_type(tuple(family.settings for family in families.values()))


@cache
def _experiment_type(fits: tuple[type[FitSettings], ...]) -> type[Experiment]:
    union: Any = Union.__getitem__(fits)
    fit: Any = Annotated[union, Field(discriminator="family")] if len(fits) > 1 else union
    field: Any = Field(default_factory=dict, description=Experiment.model_fields["fits"].description)
    fields: Any = {"fits": (dict[Name, fit], field)}
    return create_model("Experiment", __base__=Experiment, __doc__=Experiment.__doc__, **fields)
