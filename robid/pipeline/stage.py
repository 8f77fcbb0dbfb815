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
    """What a stage reads and writes for one campaign, design or fit.

    Attributes:
        outputs: Files in the run folder, the main one first.
        settings: Settings that it reads, by dotted name; nothing else may change its result.
        inputs: Files in the run folder that it reads, by name.
        files: Files elsewhere that it reads, by name.
        needed_bytes: Room on the disk that it may need.
    """

    outputs: tuple[str, ...]
    settings: dict[str, Any]
    inputs: dict[str, str] = field(default_factory=dict)
    files: dict[str, Path] = field(default_factory=dict)
    needed_bytes: float = 0.0


@dataclass(frozen=True)
class Job:
    """One run of a stage.

    Attributes:
        loaded: The experiment.
        stage: Name of the stage.
        owner: The campaign, design or fit.
        settings: Settings that the stage reads, for the provenance.
        output: The main file to write.
        inputs: The files to read, by name.
        input_hashes: Content hash of each, by name.
        folder: The run folder.
        map: Runs independent tasks.
        threads: Threads that a single task may use.
        progress: Where to tell how far it is.
        started_utc: When it began.
    """

    loaded: LoadedExperiment
    stage: str
    owner: str
    settings: dict[str, Any]
    output: Path
    inputs: Mapping[str, Path]
    input_hashes: dict[str, str]
    folder: Path
    map: Map
    threads: int
    progress: Progress
    started_utc: str = field(default_factory=utc_now)

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
            seed=seed,
            versions=package_versions(),
            git_commit=_commit(),
            started_utc=self.started_utc,
            finished_utc=utc_now(),
        )


@dataclass(frozen=True)
class Stage:
    """A command of the chain.

    Attributes:
        name: The command.
        does: What it does, for the help.
        owned_by: What it runs for: one campaign, design or fit, or the whole experiment.
        artifact: Kind of its output, or a name of a `with later` block that stands for it; None for the report.
        owners: Names of the campaigns, designs or fits that it runs for.
        plan: What it reads and writes for one of them.
        run: Does it; returns its key figures in a phrase.
        phrase: Reads these from its output, for one of its owners.
        problem: Reads from its output what went wrong numerically; empty when all is well.
        show: Lays out from its output what its command prints below its line; None for nothing.
        told: Reads from its output what `--json` adds to its answer.
        takes_what_is_there: Whether it runs without inputs that a numerical problem has kept from being made.
        grade: Reads from its output how far to trust the model, and why; None where it does not say.
        on_request: Whether nothing reads its output, so that `run` leaves it alone; its own command makes it.
        vouched: Says why its main output does not vouch for the others, empty when it does; raises an `ArtifactError`
            where another one is foreign.
    """

    name: str
    does: str
    owned_by: Literal["campaign", "design", "fit", "experiment"]
    artifact: Kind | None
    owners: Callable[[Experiment], tuple[str, ...]]
    plan: Callable[[LoadedExperiment, str], Plan]
    run: Callable[[Job], str]
    phrase: Callable[[LoadedExperiment, str, Path], str] = lambda *_: ""
    problem: Callable[[Path], str] = lambda _: ""
    show: Callable[[Path, LoadedExperiment], Group | None] = lambda *_: None
    told: Callable[[Path], dict[str, Any]] = lambda _: {}
    takes_what_is_there: bool = False
    grade: Callable[[LoadedExperiment, str, Path], Grade | None] = lambda *_: None
    on_request: Callable[[LoadedExperiment, str], bool] = lambda *_: False
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
    return tuple(name for name in measured_campaigns(experiment) if not experiment.campaigns[name].is_one_shot)


def responding_campaigns(experiment: Experiment) -> tuple[str, ...]:
    """Names of those whose excitation is small enough for a frequency response."""
    return tuple(name for name in periodic_campaigns(experiment) if experiment.campaigns[name].has_response)


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
        raise ArtifactError(
            f"A035 The folder cannot be written to: {error.strerror or error}.",
            where=str(path.parent),
            remedy="name another one with --run-dir, or change its permissions",
        ) from error
    if free < needed_bytes:
        raise ArtifactError(
            f"A036 The disk has {free / 1e6:.0f} MB left, but {needed_bytes / 1e6:.0f} MB are needed.",
            where=str(path.parent),
            remedy="make room, or name another folder with --run-dir",
        )


def counted(number: int, noun: str) -> str:
    """Writes a number of things, as in `1 line` and `2 lines`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


@functools.cache
def _commit() -> str:
    return git_commit()
