"""What a family of models is: everything that carries it from the experiment file to the page, as a value."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from robid.artifacts.artifact import Artifact
    from robid.backends.map import Map, Progress
    from robid.frf.frf import Frf
    from robid.report.page import FitReport
    from robid.settings.experiment import Experiment
    from robid.settings.fits import FitSettings, HandedOn, Read
    from robid.settings.load import LoadedExperiment
    from robid.settings.robot import RobotFile
    from robid.settings.yaml import FieldPath
    from robid.signals.record import Record
    from robid.simulate.truth import TrueRobot


@dataclass(frozen=True)
class Data:
    """What a fit or its validation reads.

    Attributes:
        loaded: The experiment.
        name: Name of the fit.
        frf: Response of the campaigns that it reads, joined and in the configurations of the fit; None where the
            family reads none.
        records: Record of each campaign, where the family reads them.
        configurations: Index of each configuration of the response in its campaigns, those of further ones counted on.
        taken: Models of the fits that it takes something of, by what it takes.
        origins: Campaign of each configuration of the response, where a fit reads one.
    """

    loaded: LoadedExperiment
    name: str
    frf: Frf | None
    records: tuple[Record, ...] = ()
    configurations: tuple[int, ...] = ()
    taken: Mapping[HandedOn, Artifact] = field(default_factory=dict)
    origins: tuple[str, ...] = ()

    @property
    def settings(self) -> FitSettings:
        """The fit's settings."""
        return self.loaded.experiment.fits[self.name]

    @property
    def response(self) -> Frf:
        """The response, for a family that reads one."""
        if self.frf is None:
            message = f"fit {self.name} reads no response"
            raise RuntimeError(message)
        return self.frf


@dataclass(frozen=True)
class Work:
    """How a fit is computed: what runs independent tasks, and where it tells how far it is."""

    map: Map
    progress: Progress


@dataclass(frozen=True)
class Shown:
    """A fit with everything that the report may show of it.

    Attributes:
        data: What it read.
        model: Its artifact.
        validation: Artifact of its validation, if there is one.
        new: What the validation read.
        true: True value of each parameter by name; empty for a measured robot.
        told: What the page warns of anyway.
        beside: The run's other fits of the family, which may have measured the same.
    """

    data: Data
    model: Artifact
    validation: Artifact | None = None
    new: Data | None = None
    true: Mapping[str, float] = field(default_factory=dict)
    told: tuple[str, ...] = ()
    beside: tuple[Shown, ...] = ()


@dataclass(frozen=True)
class ExportTask:
    """What is exported.

    Attributes:
        data: What the fit read.
        model: Its artifact.
        configuration: Index of one configuration; None for all of the fit.
        friction: Whether friction is in, where a format can hold it; None where nothing was said.
        suffix: Suffix of the file.
    """

    data: Data
    model: Artifact
    configuration: int | None
    friction: bool | None
    suffix: str


@dataclass(frozen=True)
class Export:
    """A format that a model can be written in.

    Attributes:
        file: Name of the file where none is given.
        suffixes: Suffixes that the file may have.
        make: Makes the file's content.
        takes_configuration: Whether it may hold a single configuration.
        takes_friction: Whether friction may be in or out.
    """

    file: str
    suffixes: tuple[str, ...]
    make: Callable[[ExportTask], bytes]
    takes_configuration: bool = True
    takes_friction: bool = False


def verdict_of(validation: Artifact) -> str:
    """Says what a validation found, from its artifact."""
    from robid.artifacts.results import outcome_from_artifact

    return outcome_from_artifact(validation).verdict


@dataclass(frozen=True)
class Family:
    """A kind of model.

    Loading a file and the graph need its settings, problems, decides and the names of its exports: they import no
    science. What fits, validates and writes is imported with its first call, see `robid.later`.

    Attributes:
        name: What `family` says in an experiment file.
        settings: Type of its fits, its `family` a literal of the name; or a name of a `with later` block that stands
            for it, so that only experiments with such fits import it.
        reads: What of a campaign a fit reads.
        problems: Finds what is wrong with one of its fits for a robot, by the fit's name: fields below the fit and
            messages.
        decides: Settings by dotted name that decide what a fit makes of a campaign, beside those of the fit itself;
            takes the campaign's name.
        fit: Fits a model and grades it by itself; the stage adds the provenance.
        validate: Holds a fitted model against data that it never saw; takes the data, the model, and the true robot
            where it is known.
        phrase: How a fit ended, from its artifact.
        report: Lays out a fit for page, terminal and summary.
        exports: Formats that a model can be written in, by name.
        seed: Seed of a fit, for its provenance.
        true_values: True value of every parameter, by name, in a true robot; takes the fit's name.
        verdict: What a validation found, from its artifact.
        compare: Numbers that compare fits of this family with each other, by dotted name.
        free_too: The experiment with more names in a fit's `free`, checked; takes the fit's name. None where nothing
            can be estimated.
        refit: Fits again from the minimum of a model, with what the data's experiment now frees.
        needs_robot: Whether its fits ask for the inside of the robot, so that the experiment must name one.
        misfits: How badly a model describes its data, and data that it never saw where it was validated: positive
            numbers by name, by which models of a fleet are compared; only large ones are suspicious.
    """

    name: str
    settings: type[FitSettings]
    reads: tuple[Read, ...]
    problems: Callable[[Experiment, str, RobotFile], Iterator[tuple[FieldPath, str]]]
    decides: Callable[[LoadedExperiment, str], dict[str, Any]]
    fit: Callable[[Data, Work], Artifact]
    validate: Callable[[Data, Artifact, TrueRobot | None], Artifact]
    phrase: Callable[[Artifact], str]
    report: Callable[[Shown], FitReport]
    exports: Mapping[str, Export]
    seed: Callable[[FitSettings], int | None] = lambda _settings: None
    true_values: Callable[[LoadedExperiment, str, TrueRobot], Mapping[str, float]] = lambda _loaded, _fit, _true: {}
    verdict: Callable[[Artifact], str] = verdict_of
    compare: Callable[[Sequence[Shown]], Mapping[str, float]] = lambda _every: {}
    free_too: Callable[[LoadedExperiment, str, Sequence[str]], LoadedExperiment] | None = None
    refit: Callable[[Data, Artifact, Work], Artifact] | None = None
    needs_robot: bool = True
    misfits: Callable[[Artifact, Artifact | None], Mapping[str, float]] = lambda _model, _validation: {}


def family_of(loaded: LoadedExperiment, fit: str) -> Family:
    """Returns the family of one of an experiment's fits."""
    family = loaded.families[loaded.experiment.fits[fit].family]
    if not isinstance(family, Family):
        message = f"{family.name} is no family"
        raise TypeError(message)
    return family
