"""A run folder, opened: what its campaigns, designs and fits hold, each read when it is asked for."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

from robid.artifacts.artifact import Artifact
from robid.artifacts.kinds import DESIGN, FRF, RECORD, design_from_artifact, frf_from_artifact, record_from_artifact
from robid.artifacts.results import (
    MODEL,
    VALIDATION,
    estimate_from_artifact,
    outcome_from_artifact,
    read_grade,
)
from robid.artifacts.store import read_artifact, read_attributes, read_group, read_header
from robid.errors import ArtifactError
from robid.face.parameters import Parameters
from robid.files import read_regular_text
from robid.frf.joined import join
from robid.models.residuals import STORED_RESIDUALS

if TYPE_CHECKING:
    from robid.design.configurations.information import ConfigurationDesign
    from robid.frf.frf import Frf
    from robid.results.finding import Finding
    from robid.results.grade import Grade
    from robid.results.residual import Residual
    from robid.signals.record import Record

_Value = TypeVar("_Value")


class Stored(Mapping[str, _Value], Generic[_Value]):
    """Files of a run folder by the name of what they belong to, each read when it is asked for.

    Args:
        what: What a name stands for, as `campaign`.
        paths: Where each lies.
        read: Reads one.
    """

    def __init__(self, what: str, paths: Mapping[str, Path], read: Callable[[Path], _Value]) -> None:
        self._what, self._paths, self._read = what, dict(paths), read

    def __getitem__(self, name: str) -> _Value:
        if name not in self._paths:
            raise KeyError(f"there is no {self._what} `{name}`; there are {', '.join(self._paths) or 'none'}")
        return self._read(self._paths[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self._paths)

    def __len__(self) -> int:
        return len(self._paths)

    def __repr__(self) -> str:
        return f"<{', '.join(self._paths) or 'none'}>"


@dataclass(frozen=True)
class StoredFit:
    """A fit of a run folder."""

    folder: Path  # Where it lies

    @cached_property
    def kind(self) -> str:
        """Its kind of model, as `elastic`."""
        return str(read_attributes(self._model, MODEL)["family"])

    @cached_property
    def parameters(self) -> Parameters:
        """Its parameters with both intervals, without a check of the file's hash."""
        return Parameters(estimate_from_artifact(read_group(self._model, MODEL, "estimate")))

    @cached_property
    def grade(self) -> Grade | None:
        """How far to trust it, with its reasons; None where nothing validated it."""
        return read_grade(self._validation, VALIDATION) if self._validation.exists() else None

    @property
    def sentence(self) -> str:
        """The grade, and why it is no better; without a validation, what the fit is worth by itself."""
        return (self.grade or read_grade(self._model, MODEL)).sentence

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What speaks against it, the first to blame first; `sentence` of each says it with its likely cause."""
        return (self.grade or read_grade(self._model, MODEL)).findings

    @property
    def reasons(self) -> tuple[str, ...]:
        """What keeps it from a better grade, a clause each, the worst first."""
        return (self.grade or read_grade(self._model, MODEL)).reasons

    @cached_property
    def responses(self) -> Frf | None:
        """Responses that it was fitted to; None where it read records, or they are gone or made anew since."""
        origin = read_header(self._model, MODEL).provenance
        settings = origin.settings[f"fits.{self.folder.name}"]
        campaigns = [settings["from"]] if isinstance(settings["from"], str) else list(settings["from"])
        paths = [self.folder.parents[1] / campaign / "frf.h5" for campaign in campaigns]
        read_ones = [value for name, value in origin.inputs.items() if name.startswith("frf")]
        if not read_ones or [_content(path) for path in paths] != read_ones:
            return None
        read = [frf_from_artifact(read_artifact(path, FRF)) for path in paths]
        whole = read[0] if len(read) == 1 else join(read, campaigns)
        return whole if settings.get("configurations") is None else whole.select(settings["configurations"])

    @cached_property
    def residual(self) -> Residual:
        """Its data less its model, and that whitened."""
        return STORED_RESIDUALS[self.kind](self.model, self.responses)

    @property
    def verdict(self) -> str:
        """What its validation found; empty without one."""
        if not self._validation.exists():
            return ""
        return outcome_from_artifact(read_artifact(self._validation, VALIDATION)).verdict

    @property
    def model(self) -> Artifact:
        """All that the fit found, its file checked: datasets with units and axes by name."""
        return read_artifact(self._model, MODEL)

    @property
    def _model(self) -> Path:
        return self.folder / "model.h5"

    @property
    def _validation(self) -> Path:
        return self.folder / "validation.h5"

    def __repr__(self) -> str:
        return f"{self.kind} fit {self.folder.name}, {self.parameters.counted}\n{self.sentence}"


def _content(path: Path) -> str:
    return read_header(path, FRF).content_sha256 if path.is_file() else ""


@dataclass(frozen=True)
class RunFolder:
    """A run folder: what `robid run` and the stages have made so far."""

    folder: Path  # Where it lies

    @property
    def fits(self) -> Stored[StoredFit]:
        """Fits by name."""
        return Stored("fit", self._owners("fits/*/model.h5"), lambda path: StoredFit(path.parent))

    @property
    def responses(self) -> Stored[Frf]:
        """Frequency responses with their covariance, by campaign."""
        return Stored(
            "response of a campaign", self._owners("*/frf.h5"), lambda path: frf_from_artifact(read_artifact(path, FRF))
        )

    @property
    def records(self) -> Stored[Record]:
        """Recorded or simulated signals, by campaign."""
        return Stored(
            "record of a campaign",
            self._owners("*/record.h5"),
            lambda path: record_from_artifact(read_artifact(path, RECORD)),
        )

    @property
    def designs(self) -> Stored[ConfigurationDesign]:
        """Choices of configurations, by name."""
        paths = {path.stem: path for path in sorted(self.folder.glob("designs/*.h5"))}
        return Stored("design", paths, lambda path: design_from_artifact(read_artifact(path, DESIGN)))

    @property
    def figures(self) -> dict[str, float]:
        """What the run's summary says in numbers, by dotted name; none before a report was made."""
        path = self.folder / "summary.json"
        return {} if not path.exists() else dict(json.loads(read_regular_text(path)))

    def _owners(self, pattern: str) -> dict[str, Path]:
        return {path.parent.name: path for path in sorted(self.folder.glob(pattern))}

    def __repr__(self) -> str:
        parts = ("fits", "responses", "records", "designs")
        return "\n".join([f"run folder {self.folder}", *(f"  {part}: {getattr(self, part)!r}" for part in parts)])


def open(folder: str | Path) -> RunFolder:  # noqa: A001  it is used as `robid.open`
    """Opens a run folder, as `runs/kr300`; its files are read when they are asked for.

    Raises:
        ArtifactError: If there is no such folder, or it holds nothing that robid made.
    """
    path = Path(folder)
    opened = RunFolder(path)
    if not any((opened.fits, opened.responses, opened.records, opened.designs)):
        what = "A037 There is no run folder" if not path.is_dir() else "A038 The folder contains no artifact of a run"
        remedy = "name the folder that `robid run` wrote, as runs/<name>"
        raise ArtifactError(what, where=str(folder), remedy=remedy)
    return opened
