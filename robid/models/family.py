"""What a family of models is: everything that carries it from the experiment file to the page, as a value."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from robid.artifacts.artifact import Artifact, Kind
    from robid.artifacts.parts import Parts
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
    """What a fit or its validation reads."""

    loaded: LoadedExperiment  # the experiment
    name: str  # name of the fit
    # Response of the campaigns that it reads, joined and in the configurations of the fit; None where the family reads
    # none.
    frf: Frf | None
    records: tuple[Record, ...] = ()  # record of each campaign, where the family reads them
    # Index of each configuration of the response in its campaigns, those of further ones counted on.
    configurations: tuple[int, ...] = ()
    # Models of the fits that it takes something of, by what it takes.
    taken: Mapping[HandedOn, Artifact] = field(default_factory=dict)
    origins: tuple[str, ...] = ()  # campaign of each configuration of the response, where a fit reads one
    rows: tuple[int, ...] = ()  # index of each of them in its campaign

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
    # Makes the folder of what an unfinished fit keeps, for a kind of parts; None where it keeps nothing.
    kept: Callable[[Kind], Parts] | None = None


@dataclass(frozen=True)
class Shown:
    """A fit with everything that the report may show of it."""

    data: Data  # what it read
    model: Artifact  # its artifact
    validation: Artifact | None = None  # artifact of its validation, if there is one
    new: Data | None = None  # what the validation read
    # True value of each parameter by name; empty for a measured robot.
    true: Mapping[str, float] = field(default_factory=dict)
    told: tuple[str, ...] = ()  # what the page warns of anyway
    beside: tuple[Shown, ...] = ()  # the run's other fits of the family, which may have measured the same
    # Reads the record of one configuration of a campaign, by name and index; None where there is none, or nobody looks.
    record: Callable[[str, int], Record | None] = lambda _campaign, _row: None


@dataclass(frozen=True)
class ExportTask:
    """What is exported."""

    data: Data  # what the fit read
    model: Artifact  # its artifact
    configuration: int | None  # index of one configuration; None for all of the fit
    friction: bool | None  # whether friction is in, where a format can hold it; None where nothing was said
    suffix: str  # suffix of the file


@dataclass(frozen=True)
class Export:
    """A format that a model can be written in."""

    file: str  # name of the file where none is given
    suffixes: tuple[str, ...]  # suffixes that the file may have
    make: Callable[[ExportTask], bytes]  # makes the file's content
    takes_configuration: bool = True  # whether it may hold a single configuration
    takes_friction: bool = False  # whether friction may be in or out


def verdict_of(validation: Artifact) -> str:
    """Says what a validation found, from its artifact."""
    from robid.artifacts.results import outcome_from_artifact

    return outcome_from_artifact(validation).verdict


@dataclass(frozen=True)
class Family:
    """A kind of model.

    Loading a file and the graph need its settings, problems, decides and the names of its exports: they import no
    science. What fits, validates and writes is imported with its first call, see `robid.later`.
    """

    name: str  # what `family` says in an experiment file
    # Type of its fits, its `family` a literal of the name; or a name of a `with later` block that stands for it, so
    # that only experiments with such fits import it.
    settings: type[FitSettings]
    reads: tuple[Read, ...]  # what of a campaign a fit reads
    # Finds what is wrong with one of its fits for a robot, by the fit's name: fields below the fit and messages.
    problems: Callable[[Experiment, str, RobotFile], Iterator[tuple[FieldPath, str]]]
    # Settings by dotted name that decide what a fit makes of a campaign, beside those of the fit itself; takes the
    # campaign's name.
    decides: Callable[[LoadedExperiment, str], dict[str, Any]]
    fit: Callable[[Data, Work], Artifact]  # fits a model and grades it by itself; the stage adds the provenance
    # Holds a fitted model against data that it never saw; takes the data, the model, and the true robot where it is
    # known.
    validate: Callable[[Data, Artifact, TrueRobot | None], Artifact]
    phrase: Callable[[Artifact], str]  # how a fit ended, from its artifact
    report: Callable[[Shown], FitReport]  # lays out a fit for page, terminal and summary
    exports: Mapping[str, Export]  # formats that a model can be written in, by name
    seed: Callable[[FitSettings], int | None] = lambda _settings: None  # seed of a fit, for its provenance
    # True value of every parameter, by name, in a true robot; takes the fit's name.
    true_values: Callable[[LoadedExperiment, str, TrueRobot], Mapping[str, float]] = lambda _loaded, _fit, _true: {}
    verdict: Callable[[Artifact], str] = verdict_of  # what a validation found, from its artifact
    # Numbers that compare fits of this family with each other, by dotted name.
    compare: Callable[[Sequence[Shown]], Mapping[str, float]] = lambda _every: {}
    # The experiment with more names in a fit's `free`, checked; takes the fit's name. None where nothing can be freed.
    free_too: Callable[[LoadedExperiment, str, Sequence[str]], LoadedExperiment] | None = None
    # Fits again from the minimum of a model, with what the data's experiment now frees.
    refit: Callable[[Data, Artifact, Work], Artifact] | None = None
    needs_robot: bool = True  # whether its fits ask for the inside of the robot, so that the experiment must name one
    # How badly a model describes its data, and data that it never saw where it was validated: positive numbers by name,
    # by which models of a fleet are compared; only large ones are suspicious.
    misfits: Callable[[Artifact, Artifact | None], Mapping[str, float]] = lambda _model, _validation: {}
    # What fits and validates in its place where campaigns have responses alone; None where it does so itself.
    of_responses: Family | None = None


def family_of(loaded: LoadedExperiment, fit: str) -> Family:
    """Returns the family of one of an experiment's fits."""
    family = loaded.families[loaded.experiment.fits[fit].family]
    if not isinstance(family, Family):
        message = f"{family.name} is no family"
        raise TypeError(message)
    first = loaded.experiment.campaigns.get(loaded.experiment.fits[fit].campaigns[0])
    if family.of_responses is not None and first is not None and first.is_response:
        return family.of_responses
    return family
