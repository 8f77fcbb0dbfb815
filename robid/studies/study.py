"""What a study is: its settings' check, and what it needs, does and concludes, imported when it runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from robid.artifacts.artifact import Artifact
    from robid.pipeline.graph import Run
    from robid.settings.experiment import Experiment
    from robid.settings.load import LoadedExperiment
    from robid.settings.robot import RobotFile
    from robid.settings.yaml import FieldPath
    from robid.studies.conclusion import Conclusion
    from robid.studies.tasks import Function, Results, Task

TASKS = "tasks"

Earlier: TypeAlias = "tuple[Results, ...]"
"""Results of the steps before."""


@dataclass(frozen=True)
class Step:
    """Tasks of a study that can all be done once the steps before are done.

    Attributes:
        name: Name of its folder below that of the tasks; a study's only step has none.
        tasks: Its tasks.
        function: Does one of them.
    """

    name: str
    tasks: Callable[[Run, Earlier], list[Task]]
    function: Function

    @property
    def folder(self) -> str:
        """Where its results lie in the run folder."""
        return f"{TASKS}/{self.name}" if self.name else TASKS


@dataclass(frozen=True)
class Procedure:
    """What a study needs, does and concludes.

    Attributes:
        needs: Outputs of the chain that its tasks read.
        steps: Its tasks, once these are there.
        conclude: Turns the results of all steps into what the study found.
        further: Other experiments that it reads, each with outputs of its chain.
    """

    needs: Callable[[LoadedExperiment], tuple[str, ...]]
    steps: tuple[Step, ...]
    conclude: Callable[[Run, Earlier], Conclusion]
    further: Callable[[Run], tuple[tuple[Run, tuple[str, ...]], ...]] = lambda _run: ()


@dataclass(frozen=True)
class Study:
    """A kind of study. Loading a file needs its check alone, which imports no science.

    Attributes:
        check: Finds what is wrong between its settings, the experiment and the robot file, where that could be read:
            fields and messages.
        procedure: Imports what it runs.
    """

    check: Callable[[Experiment, RobotFile | None], Iterator[tuple[FieldPath, str]]]
    procedure: Callable[[], Procedure]


def one_step(
    needs: Callable[[LoadedExperiment], tuple[str, ...]],
    tasks: Callable[[Run], list[Task]],
    function: Function,
    conclude: Callable[[Run, list[Artifact]], Conclusion],
) -> Procedure:
    """Returns the procedure of a study whose tasks wait for no others."""
    step = Step("", lambda run, _: tasks(run), function)
    return Procedure(needs, (step,), lambda run, results: conclude(run, list(results[0])))
