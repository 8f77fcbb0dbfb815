"""What a part of a study is: its tasks, what it found, and what is asked of that."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from robid.artifacts.artifact import Artifact
from robid.pipeline.graph import Run
from robid.report.section import Section
from robid.studies.study import Earlier, Step
from robid.studies.tasks import Content, Function, Results, Task


@dataclass(frozen=True)
class Asked:
    """What is asked of a figure.

    Attributes:
        lower: The least that it may be.
        upper: The most that it may be.
    """

    lower: float = float("-inf")
    upper: float = float("inf")

    def is_reached(self, value: float) -> bool:
        """Whether a figure lies within."""
        return self.lower <= value <= self.upper


@dataclass(frozen=True)
class PartFound:
    """What a part of a study found.

    Attributes:
        figures: Figures by their name in summary.json.
        asked: What is asked of some of them.
        sections: Tables and figures of the page.
        warnings: Why something is left out, where it is.
    """

    figures: dict[str, float]
    asked: dict[str, Asked] = field(default_factory=dict)
    sections: tuple[Section, ...] = ()
    warnings: tuple[str, ...] = ()


def _no_tasks(_run: Run) -> list[Task]:
    return []


def _nothing(_argument: object) -> Content:
    raise NotImplementedError


def _none_further(_run: Run) -> tuple[tuple[Run, tuple[str, ...]], ...]:
    return ()


@dataclass(frozen=True)
class Part:
    """A part of a study of several.

    Attributes:
        name: Its name, and that of the folder of its tasks.
        conclude: Turns the results of its tasks into what it found; None where the study leaves it out.
        tasks: Its tasks.
        function: Does one of them.
        further: Other experiments that it reads, each with outputs of its chain.
        following: Its tasks where these need what parts before it found, by their name; in the place of `tasks`.
    """

    name: str
    conclude: Callable[[Run, Sequence[Artifact]], PartFound | None]
    tasks: Callable[[Run], list[Task]] = _no_tasks
    function: Function = _nothing
    further: Callable[[Run], tuple[tuple[Run, tuple[str, ...]], ...]] = _none_further
    following: Callable[[Run, Mapping[str, Results]], list[Task]] | None = None

    def step(self, before: Sequence[str]) -> Step:
        """Returns its tasks as a step of the study, the parts before it named."""

        def tasks(run: Run, earlier: Earlier) -> list[Task]:
            if self.following is None:
                return self.tasks(run)
            return self.following(run, dict(zip(before, earlier, strict=True)))

        return Step(self.name, tasks, self.function)
