"""What a stage is, what it is given, and what it leaves behind."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from robid.artifacts.artifact import Kind, Provenance, canonical_hash, git_commit, package_versions, utc_now
from robid.errors import ArtifactError
from robid.later import imported

if TYPE_CHECKING:
    from rich.console import Group

    from robid.backends.map import Map, Progress
    from robid.results.grade import Grade
    from robid.settings.experiment import Campaign, Experiment
    from robid.settings.load import LoadedExperiment


@dataclass(frozen=True)
class Plan:
    """What a stage reads and writes for one campaign, design or fit."""

    outputs: tuple[str, ...]  # files in the run folder, the main one first
    settings: dict[str, Any]  # settings that it reads, by dotted name; nothing else may change its result
    inputs: dict[str, str] = field(default_factory=dict)  # files in the run folder that it reads, by name
    files: dict[str, Path] = field(default_factory=dict)  # files elsewhere that it reads, by name
    needed_bytes: float = 0.0  # room on the disk that it may need
    kind: Kind | None = None  # kind of the main one, where it is not the stage's


@dataclass(frozen=True)
class Job:
    """One run of a stage."""

    loaded: LoadedExperiment  # the experiment
    stage: str  # name of the stage
    owner: str  # the campaign, design or fit
    settings: dict[str, Any]  # settings that the stage reads, for the provenance
    output: Path  # the main file to write
    inputs: Mapping[str, Path]  # the files to read, by name
    input_hashes: dict[str, str]  # content hash of each, by name
    folder: Path  # the run folder
    map: Map  # runs independent tasks
    threads: int  # threads that a single task may use
    progress: Progress  # where to tell how far it is
    started_utc: str = field(default_factory=utc_now)  # when it began
    named: tuple[str, ...] = ()  # inputs that the command line named in place of the run folder's

    @property
    def campaign(self) -> Campaign:
        """The campaign, for stages whose owner is one."""
        return self.loaded.experiment.campaigns[self.owner]

    @property
    def key(self) -> str:
        """Hash of everything that decides the result."""
        return canonical_hash([self.settings, self.input_hashes])

    def provenance(self, seed: int | None = None) -> Provenance:
        """Returns how the output comes about, finished now."""
        return Provenance(
            stage=self.stage,
            settings=self.settings,
            settings_hash=canonical_hash(self.settings),
            inputs=self.input_hashes,
            named=list(self.named),
            seed=seed,
            versions=package_versions(),
            git_commit=_commit(),
            started_utc=self.started_utc,
            finished_utc=utc_now(),
        )


@dataclass(frozen=True)
class Stage:
    """A command of the chain."""

    name: str  # the command
    does: str  # what it does, for the help
    # What it runs for: one campaign, design or fit, or the whole experiment.
    owned_by: Literal["campaign", "design", "fit", "experiment"]
    # Kind of its output, or a name of a `with later` block that stands for it; None for the report.
    artifact: Kind | None
    owners: Callable[[Experiment], tuple[str, ...]]  # names of the campaigns, designs or fits that it runs for
    plan: Callable[[LoadedExperiment, str], Plan]  # what it reads and writes for one of them
    run: Callable[[Job], str]  # does it; returns its key figures in a phrase
    # Reads these from its output, for one of its owners.
    phrase: Callable[[LoadedExperiment, str, Path], str] = lambda *_: ""
    # Reads from its output what went wrong numerically; empty when all is well.
    problem: Callable[[Path], str] = lambda _: ""
    # Lays out from its output what its command prints below its line; None for nothing.
    show: Callable[[Path, LoadedExperiment], Group | None] = lambda *_: None
    told: Callable[[Path], dict[str, Any]] = lambda _: {}  # reads from its output what `--json` adds to its answer
    # Whether it runs without inputs that a numerical problem has kept from being made.
    takes_what_is_there: bool = False
    # Reads from its output how far to trust the model, and why; None where it does not say.
    grade: Callable[[LoadedExperiment, str, Path], Grade | None] = lambda *_: None
    # Whether nothing reads its output, so that `run` leaves it alone; its own command makes it.
    on_request: Callable[[LoadedExperiment, str], bool] = lambda *_: False
    # Says why its main output does not vouch for the others, empty when it does; raises an `ArtifactError` where
    # another one is foreign.
    vouched: Callable[[Sequence[Path]], str] = lambda _: ""

    @property
    def kind(self) -> Kind | None:
        """Kind of its output; None for the report."""
        return None if self.artifact is None else imported(self.artifact)


def measured_campaigns(experiment: Experiment) -> tuple[str, ...]:
    """Names of the campaigns that have a source."""
    return tuple(name for name, campaign in experiment.campaigns.items() if campaign.source is not None)


def periodic_campaigns(experiment: Experiment) -> tuple[str, ...]:
    """Names of the campaigns that have a source and an excitation that repeats."""
    campaigns = experiment.campaigns
    measured = measured_campaigns(experiment)
    return tuple(name for name in measured if not (campaigns[name].is_one_shot or campaigns[name].is_response))


def responding_campaigns(experiment: Experiment) -> tuple[str, ...]:
    """Names of those whose excitation is small enough for a frequency response, or that are given as responses."""
    played = periodic_campaigns(experiment)
    campaigns = experiment.campaigns
    given = tuple(name for name in measured_campaigns(experiment) if campaigns[name].is_response)
    return (*(name for name in played if campaigns[name].has_response), *given)


def check_room(path: Path, needed_bytes: float) -> None:
    """Refuses a folder that cannot be written to or whose disk is too full, before a long computation.

    Raises:
        ArtifactError: If it is so.
    """
    import shutil
    import tempfile

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path.parent):
            pass
        free = shutil.disk_usage(path.parent).free
    except OSError as error:
        message = f"A035 The folder cannot be written to: {error.strerror or error}."
        remedy = "name another one with --run-dir, or change its permissions"
        raise ArtifactError(message, where=str(path.parent), remedy=remedy) from error
    if free < needed_bytes:
        message = f"A036 The disk has {free / 1e6:.0f} MB left, but {needed_bytes / 1e6:.0f} MB are needed."
        remedy = "make room, or name another folder with --run-dir"
        raise ArtifactError(message, where=str(path.parent), remedy=remedy)


def counted(number: int, noun: str) -> str:
    """Writes a number of things, as in `1 line` and `2 lines`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


@functools.cache
def _commit() -> str:
    return git_commit()
