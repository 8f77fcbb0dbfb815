"""Models of the experiment file."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any, Literal, Union

import pydantic.dataclasses
from pydantic import ConfigDict, Field, create_model, model_validator

from robid.arrays import group, option
from robid.design.configurations.options import CostOptions, DesignOptions, InformationOptions, OutputName
from robid.design.excitation.options import (
    ArbitraryOptions,
    ChosenLineOptions,
    MultisineOptions,
    PoseChirpOptions,
    SignalOptions,
    TrajectoryOptions,
)
from robid.frf.options import EstimateOptions
from robid.later import imported
from robid.settings.base import STRICT, Name, Section
from robid.settings.fits import Families, FitSettings, part
from robid.settings.numbering import counts_from
from robid.settings.robot import RobotFile
from robid.settings.sources import Acquire, ExcitationSettings, ResponseSource, SimulateSettings

Rows = Annotated[tuple[Annotated[tuple[float, ...], Field(min_length=1)], ...], Field(min_length=1)]
_ONE_KEY = ConfigDict(json_schema_extra={"minProperties": 1, "maxProperties": 1})


class OneKey(Section):
    """A choice among sections that is made by writing exactly one of the keys."""

    model_config = _ONE_KEY

    @model_validator(mode="after")
    def _has_one_key(self) -> OneKey:
        if len(self.model_fields_set) != 1 or getattr(self, next(iter(self.model_fields_set))) is None:
            keys = [info.alias or name for name, info in type(self).model_fields.items()]
            message = f"S306 needs exactly one of {', '.join(f'`{key}`' for key in keys)}"
            raise ValueError(message)
        return self


class RandomConfigurations(Section):
    """Robot configurations drawn uniformly within the joint limits; what is out of reach is drawn again."""

    count: int = Field(description="Number of configurations.", ge=1, le=10_000)
    seed: int = option(1, "Seed of the draw.", ge=0)
    margin_deg: float = option(10.0, "Distance kept from the joint limits [deg].", ge=0)
    margin_m: float = option(0.05, "The same of prismatic joints [m].", ge=0)


class Configurations(OneKey):
    """The robot configurations of a campaign; exactly one of the keys."""

    list_deg: Rows | None = option(None, "Joint angles, one row per configuration [deg].")
    positions: Rows | None = Field(
        default=None,
        alias="list",
        description="In place of `list_deg` where joints are prismatic: angles [deg] and positions [m].",
    )
    random: RandomConfigurations | None = option(None, "Drawn within the joint limits.")
    grid_deg: Rows | None = option(
        None, "Angles of each joint, one row per joint; every combination is measured [deg]."
    )
    grid: Rows | None = option(
        None, "In place of `grid_deg` where joints are prismatic: angles [deg] and positions [m]."
    )
    chosen_by: Name | Annotated[tuple[Name, ...], Field(min_length=1)] | None = Field(
        default=None,
        alias="from",
        description="Name of the design that chooses them, or a list of several, one after the other.",
    )
    mirror: Name | None = option(
        None, "Name of a design whose choice is mirrored at the vertical plane through the world's x axis."
    )
    join: tuple[Configurations, ...] | None = option(
        None, "A list of such sections, one after the other.", min_length=1
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


class Source(OneKey):
    """Where a campaign's record comes from; exactly one of the keys."""

    simulate: SimulateSettings | None = option(None, "Simulated in closed loop.")
    acquire: Acquire | None = option(None, "Imported from a log.")
    response: ResponseSource | None = option(
        None, "Frequency responses without a record: of an analyser, MATLAB, or a drive's commissioning software."
    )

    @property
    def measured(self) -> Acquire | ResponseSource | None:
        """What was measured on a real robot: logs or responses, with their channels."""
        return self.acquire or self.response


class Campaign(Section):
    """One set of experiments in one set of robot configurations."""

    configurations: Configurations | None = option(None, "The robot configurations; logs of one shot need none.")
    payload_kg: float | None = option(None, "Payload mass; the robot file's when not given [kg].", ge=0)
    excitation: ExcitationSettings = group(MultisineOptions, "Excitation of the motors.")
    realizations: int = option(1, "Blocks of experiments with new random phases.", ge=1, le=10_000)
    experiments: int | None = option(
        None,
        "Experiments of each block; as many as motors when not given. Fewer need `estimate.estimator: "
        "local_periodic` and dense linear lines. On the simulated KR300 (195 odd lines, noise, no friction) "
        "the diagonal's error stays within 1.5x of the full block's in three cases. These are 2 of 6 "
        "experiments and `local_denominator: 2`; 3 experiments and a polynomial in a single realization; and, "
        "with 4 realizations, 1 experiment, `local_order: 4` and `local_denominator: 2`. Logs of one shot have "
        "one unless given.",
        ge=1,
        le=10_000,
    )
    periods: int = option(2, "Recorded periods of each experiment.", ge=1, le=100_000)
    outputs: tuple[str, ...] = option(
        ("motors",), "What a simulation records: `motors` first, then `<joint>.arm` and the robot's `sensors`."
    )
    source: Source | None = option(None, "Source of the record; none if the campaign is not measured.")
    estimate: EstimateOptions = group(EstimateOptions, "Estimation of the frequency response from the record.")

    @property
    def designs(self) -> tuple[str, ...]:
        """Names of the designs that choose its configurations, each once."""
        return () if self.configurations is None else self.configurations.designs

    @property
    def is_one_shot(self) -> bool:
        """Whether it is imported from logs that do not repeat."""
        return self.source is not None and self.source.acquire is not None and self.source.acquire.one_shot

    @property
    def is_response(self) -> bool:
        """Whether only its frequency responses are there, without a record."""
        return self.source is not None and self.source.response is not None

    @property
    def is_trajectory(self) -> bool:
        """Whether it plays large motions, which have no frequency response."""
        return isinstance(self.excitation, TrajectoryOptions)

    @property
    def is_arbitrary(self) -> bool:
        """Whether only band and resolution of its signal are said, which need not repeat."""
        return isinstance(self.excitation, ArbitraryOptions)

    @property
    def lists_lines(self) -> bool:
        """Whether its excited lines are listed one by one."""
        return isinstance(self.excitation, ChosenLineOptions) and isinstance(self.excitation.lines, tuple)

    @property
    def finds_lines(self) -> bool:
        """Whether its logs show which lines are excited."""
        return isinstance(self.excitation, ChosenLineOptions) and self.excitation.lines == "found"

    @property
    def moves_poses(self) -> bool:
        """Whether it commands poses of the tool, position in and position out."""
        return isinstance(self.excitation, PoseChirpOptions)

    @property
    def travels(self) -> bool:
        """Whether a joint moves far beneath its excitation."""
        return isinstance(self.excitation, SignalOptions) and self.excitation.travel is not None

    @property
    def has_response(self) -> bool:
        """Whether it repeats small motions about its configurations, which have a frequency response."""
        return not (self.is_one_shot or self.is_trajectory or self.travels)

    def block_size(self, n_input: int) -> int:
        """Number of experiments in a realization: as many as inputs unless it says less, a single trajectory."""
        if isinstance(self.excitation, PoseChirpOptions):
            return len(self.excitation.channels) or n_input
        if self.is_arbitrary:
            return self.experiments or 1
        return 1 if self.is_trajectory else self.experiments or n_input

    @model_validator(mode="before")
    @classmethod
    def _estimate_follows_signal(cls, values: Any) -> Any:  # noqa: ANN401
        """Chooses what is not told of the estimate.

        Only `local` reads arbitrary signals; pose commands are no torques, of which friction could be subtracted; logs
        are compensated by `auto`, as nobody knows their friction's form beforehand.
        """
        estimate = values.get("estimate", {}) if isinstance(values, Mapping) else None
        if not isinstance(estimate, Mapping):
            return values
        signal, source = _signal(values.get("excitation")), values.get("source")
        usual = {"estimator": "local"} if signal == "arbitrary" else {}
        if signal == "pose_chirp" or (isinstance(source, Mapping) and "response" in source):
            usual["compensation"] = "none"
        elif isinstance(source, Mapping) and "acquire" in source:
            usual["compensation"] = "auto"
        return {**values, "estimate": {**usual, **estimate}} if usual.keys() - estimate.keys() else values


def _signal(excitation: Any) -> str | None:  # noqa: ANN401
    if isinstance(excitation, PoseChirpOptions | ArbitraryOptions):
        return excitation.signal
    return excitation.get("signal") if isinstance(excitation, Mapping) else None


@pydantic.dataclasses.dataclass(frozen=True, kw_only=True, config=STRICT)
class Design(CostOptions, InformationOptions, DesignOptions):
    """A choice of robot configurations among those of a campaign."""

    campaign: Name = Field(description="Name of the campaign with the configurations to choose from.")
    prior: Name | None = option(
        None,
        "Name of an earlier fit. Its information is the prior, and its estimates replace the robot file's "
        "values. The configuration that adds most to it comes first.",
    )
    between: Name | None = option(
        None,
        "Name of an earlier fit of four configurations or more. The scatter of parameters between its "
        "configurations replaces `between_relative_std`.",
    )
    fit: Name | None = option(
        None,
        "Name of the fit for which the design is made, with `weights: {mean: fit}`. Its estimator and weights "
        "replace user weights with the design's `off_diagonal` and `low_cut_hz`.",
    )

    predict_at: Name | None = option(
        None,
        "Campaign in whose configurations the model is to predict; the candidates' when not given. For `criterion: "
        "prediction`, and the comparison of every design. Lines and payload are the candidates'.",
    )
    predict: OutputName = option(
        "response",
        "What it is to predict there, by relative errors: motors' accelerations per torque (`response`), undamped "
        "resonances in the band of the excitation, the tool's motion per torque (of the payload's centre of mass; "
        "`tool_displacement`), or the torques for motions of all motors (`feedforward_torque`).",
    )

    def options(self) -> DesignOptions:
        """Returns the options of the algorithm."""
        return part(self, DesignOptions)

    def about(self) -> InformationOptions:
        """Returns which information it is made by."""
        return part(self, InformationOptions)


class Execution(Section):
    """How the experiment is computed; nothing here changes a result."""

    backend: Literal["serial", "processes", "dask"] = option(
        "processes", "Mapping of tasks to cores; `dask` needs the extra of that name."
    )
    workers: int | None = option(
        None, "Number of processes; all cores when not given. A scheduler has its own.", ge=1, le=1_000
    )
    scheduler: str | None = option(
        None,
        "Address of a Dask scheduler, as in tcp://10.0.0.1:8786, for `backend: dask`; a local cluster when not given.",
        min_length=1,
    )
    log_level: Literal["info", "warning"] = option(
        "info", "Output during a run: progress, messages and warnings, or warnings alone."
    )


class Experiment(Section):
    """An experiment file."""

    schema_version: Literal[1, 2] = Field(
        description="Version of this format. In 2 configurations count from 1, in 1 they counted from 0."
    )
    name: Name = Field(description="Name of the experiment and of its run folder.")
    robot: str | None = option(
        None,
        "The robot file, relative to this file. Not needed if the experiment only reads logs and no fit uses a "
        "model of the robot; names of channels are then free.",
        min_length=1,
    )
    campaigns: dict[Name, Campaign] = Field(description="Campaigns by name.", min_length=1)
    designs: dict[Name, Design] = group(dict, "Choices of configurations by name.")
    fits: dict[Name, FitSettings] = group(dict, "Fits by name.")
    study: Any = option(None, "Section of `robid study`, in addition to the campaigns and fits.")
    execution: Execution = group(Execution, "Settings of the computation.")

    @property
    def counts_from(self) -> int:
        """What the first configuration is called in its file; inside, indices count from 0."""
        return counts_from(self.schema_version)

    def numbered(self, count: int) -> str:
        """Says how many configurations there are, and how the file numbers them."""
        first = self.counts_from
        return f"there are {count} configurations, numbered from {first} to {count - 1 + first}"


def experiment_type(families: Families, study: Any = Any) -> type[Experiment]:  # noqa: ANN401
    """Returns the type of an experiment file of these families of fits, and of the study that `robid study` knows."""
    return _experiment_type(tuple(imported(family.settings) for family in families.values()), study)


@cache
def _experiment_type(fits: tuple[type[FitSettings], ...], study: Any) -> type[Experiment]:  # noqa: ANN401
    union: Any = Union.__getitem__(fits or (FitSettings,))
    fit: Any = Annotated[union, Field(discriminator="family")] if len(fits) > 1 else union
    field: Any = Field(default_factory=dict, description=Experiment.model_fields["fits"].description)
    about: Any = Field(default=None, description=Experiment.model_fields["study"].description)
    fields: Any = {"fits": (dict[Name, fit], field), "study": (study | None, about)}
    return create_model("Experiment", __base__=Experiment, __doc__=Experiment.__doc__, **fields)


def payload_kg(campaign: Campaign, robot: RobotFile) -> float:
    """Returns the payload mass of a campaign, the robot file's where it says nothing [kg]."""
    if campaign.payload_kg is not None:
        return campaign.payload_kg
    return 0.0 if robot.payload is None else robot.payload.mass_kg


def heaviest(experiment: Experiment, fit: FitSettings, robot: RobotFile) -> str:
    """Returns the name of a fit's campaign that knows all of its robot: the first with the largest payload."""
    return max(fit.campaigns, key=lambda name: payload_kg(experiment.campaigns[name], robot))
