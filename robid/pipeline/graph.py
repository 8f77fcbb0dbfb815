"""The graph of an experiment: what there is, what is fresh, and running what is not."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from robid.artifacts.atomic import check_folders, remove_leftovers
from robid.errors import ArtifactError, DataError, RobidError, SettingsError
from robid.pipeline.chain import STAGES
from robid.pipeline.freshness import State, check_outputs, input_hashes, state_of_output
from robid.pipeline.stage import Job, Plan, Stage, check_room
from robid.settings.other_files import opened

if TYPE_CHECKING:
    from robid.backends.map import Map, Progress
    from robid.results.grade import Grade
    from robid.settings.load import LoadedExperiment

_SMALL_BYTES = 1e6


@dataclass(frozen=True, eq=False)
class Node:
    """A stage for one campaign, design or fit."""

    stage: Stage
    owner: str
    plan: Plan

    @property
    def output(self) -> str:
        """Path of the main output in the run folder."""
        return self.plan.outputs[0]


@dataclass(frozen=True)
class Result:
    """What became of one node."""

    node: Node  # the node
    outcome: Literal["made", "fresh", "skipped"]  # `made`, `fresh` or `skipped`
    text: str  # its key figures, or why it was skipped
    problem: str = ""  # what went wrong numerically
    seconds: float = 0.0  # time it took [s]
    grade: Grade | None = None  # how far to trust the model, where the node says so

    def fails(self, *, strict: bool) -> bool:
        """Whether the command exits with 5 for it."""
        return bool(self.problem) or (self.grade is not None and self.grade.fails(strict=strict))


@dataclass(frozen=True)
class Run:
    """An experiment, its run folder, and how to compute."""

    loaded: LoadedExperiment  # the experiment
    folder: Path  # the run folder
    backend: Literal["serial", "processes", "dask"]  # how tasks are mapped to cores
    workers: int  # number of processes, or of simulation threads in serial
    scheduler: str | None = None  # address of a Dask scheduler; None for a local cluster

    @property
    def at_a_time(self) -> int:
        """How many tasks of a stage run at a time; in serial a task has all threads."""
        return 1 if self.backend == "serial" else self.workers

    def path(self, relative: str) -> Path:
        """Returns where an output lies."""
        return self.folder / relative

    def make_map(self) -> AbstractContextManager[Map]:
        """Returns what maps tasks to cores."""
        from robid.backends.map import make_map

        return make_map(self.backend, self.workers, scheduler=self.scheduler, folder=self.folder)

    def command(self, node: Node) -> str:
        """Returns the command that makes a node's output."""
        chosen = f" --{node.stage.owned_by} {node.owner}" if node.stage.owned_by != "experiment" else ""
        return f"robid {node.stage.name} {self.loaded.path}{chosen}{self.in_folder}"

    @property
    def in_folder(self) -> str:
        """What a command needs beside its experiment to work in this run folder."""
        return "" if self.folder == run_folder(self.loaded) else f" --run-dir {self.folder}"


def run_folder(loaded: LoadedExperiment) -> Path:
    """Returns the run folder of an experiment where none is named."""
    return Path("runs") / loaded.experiment.name


def graph(loaded: LoadedExperiment) -> tuple[Node, ...]:
    """Returns the nodes of an experiment, each after what it needs, short stages before long ones."""
    left = [Node(stage, name, stage.plan(loaded, name)) for stage in STAGES for name in stage.owners(loaded.experiment)]
    made: set[str] = set()
    order: list[Node] = []
    while left:
        node = next(node for node in left if made.issuperset(node.plan.inputs.values()))
        left.remove(node)
        order.append(node)
        made.update(node.plan.outputs)
    return tuple(order)


def asked_for(loaded: LoadedExperiment) -> tuple[Node, ...]:
    """Returns the nodes that a run makes: all but those whose output nothing reads."""
    return tuple(node for node in graph(loaded) if not node.stage.on_request(loaded, node.owner))


def examine(run: Run, nodes: tuple[Node, ...]) -> dict[Node, State]:
    """Tells of every node whether it is fresh, and why not."""
    states: dict[str, State] = {}
    return {node: _settle(run, node, states) for node in nodes}


def _settle(run: Run, node: Node, states: dict[str, State]) -> State:
    """Finds a node's state from those of its inputs, and notes it under each of its outputs."""
    above = {path: states[path] for path in node.plan.inputs.values()}
    gone = [path for path, state in above.items() if state.problem or state.blocked]
    if gone and not node.stage.takes_what_is_there:
        state = State(
            "missing", f"{gone[0]} has a problem: {above[gone[0]].problem or above[gone[0]].why}", blocked=True
        )
    else:
        state = state_of_output(
            node.stage, node.plan, run.folder, {path: state for path, state in above.items() if not state.blocked}
        )
    if state.unreadable is not None:
        # The remedy names the command that makes this very output.
        error = state.unreadable
        remedy = error.remedy.replace(f"robid {node.stage.name} EXPERIMENT.yaml", run.command(node))
        state = replace(state, unreadable=ArtifactError(error.what, where=error.where, remedy=remedy))
    states.update(dict.fromkeys(node.plan.outputs, state))
    return state


def needed_for(nodes: tuple[Node, ...], outputs: Collection[str]) -> tuple[Node, ...]:
    """Returns the nodes that make these outputs, and all that they need, in the same order."""
    wanted, chosen = set(outputs), []
    for node in reversed(nodes):
        if wanted.intersection(node.plan.outputs):
            chosen.append(node)
            wanted.update(node.plan.inputs.values())
    return tuple(reversed(chosen))


def run_all(
    run: Run,
    progress: Callable[[Node], AbstractContextManager[Progress]],
    tell: Callable[[Result], None],
    outputs: Collection[str] | None = None,
) -> list[Result]:
    """Runs what is not fresh, in order, all or for some outputs; what needs one with a numerical problem is skipped.

    Raises:
        RobidError: What the first node that cannot be made raised; what is finished stays.
    """
    nodes = asked_for(run.loaded) if outputs is None else needed_for(graph(run.loaded), outputs)
    _preflight(run, nodes)
    states: dict[str, State] = {}
    results = []
    with run.make_map() as parallel_map:
        for node in nodes:
            state = _settle(run, node, states)
            if state.blocked:
                result = Result(node, "skipped", state.why)
            elif state.status == "fresh":
                result = Result(node, "fresh", "", state.problem, grade=grade_of(run, node))
            else:
                inputs = {name: run.path(path) for name, path in node.plan.inputs.items() if not states[path].blocked}
                begun = time.monotonic()
                with progress(node) as shown:
                    text = execute(run, node, inputs, run.path(node.output), parallel_map, shown)
                state = State("fresh", problem=node.stage.problem(run.path(node.output)))
                states.update(dict.fromkeys(node.plan.outputs, state))
                result = Result(node, "made", text, state.problem, time.monotonic() - begun, grade_of(run, node))
            results.append(result)
            tell(result)
    return results


def grade_of(run: Run, node: Node, output: Path | None = None) -> Grade | None:
    """Reads how far to trust the model of a node's output; None where the node does not say."""
    return node.stage.grade(run.loaded, node.owner, output or run.path(node.output))


def _preflight(run: Run, nodes: tuple[Node, ...]) -> None:
    """Refuses what would fail after a long computation: outputs that are not ours, a full disk, a missing log."""
    states = examine(run, nodes)
    due = [node for node, state in states.items() if state.status != "fresh"]
    refuse_too_large(run, due)
    # What killed runs left and none resumes goes: parts of what is fresh or unknown, unfinished files.
    fresh = {path for node in nodes if node not in due for path in node.plan.outputs}
    known = {path for node in graph(run.loaded) for path in node.plan.outputs}
    check_folders(run.folder, map(run.path, known))
    remove_leftovers(run.folder, {run.path(path) for path in known - fresh})
    check_room(run.folder / "run", _SMALL_BYTES + sum(node.plan.needed_bytes for node in due))
    for state in states.values():
        if state.unreadable is not None:
            raise state.unreadable
    for node in due:
        _check_files(node)
        check_outputs(run.loaded, node.stage, node.plan, {}, run.path(node.output))


def refuse_too_large(run: Run, nodes: Iterable[Node]) -> None:
    """Refuses nodes that need more than this machine has, see `robid.pipeline.estimates`."""
    from robid.pipeline.estimates import refuse_too_large as refuse_stages

    workers = None if run.scheduler is not None else run.at_a_time
    refuse_stages(run.loaded, [(node.stage.name, node.owner) for node in nodes], run.folder, workers)


def _check_files(node: Node) -> None:
    missing = [(name, path) for name, path in node.plan.files.items() if not path.exists()]
    if missing:
        more = f", nor do {len(missing) - 1} more of its {len(node.plan.files)}" if len(missing) > 1 else ""
        message = f"D197 the {missing[0][0]} of campaign {node.owner} does not exist{more}"
        remedy = "correct `file`, or set ROBID_DATA to the folder with the data"
        raise DataError(message, where=str(missing[0][1]), remedy=remedy)
    for path in node.plan.files.values():
        if not path.is_dir():
            opened(path).close()


def execute(
    run: Run, node: Node, inputs: Mapping[str, Path], output: Path, parallel_map: Map, progress: Progress
) -> str:
    """Runs a node's stage; returns its key figures.

    Raises:
        RobidError: With the experiment file and the campaign, design or fit in its place.
    """
    refuse_too_large(run, [node])
    _check_files(node)
    check_folders(run.folder, [output])
    check_outputs(run.loaded, node.stage, node.plan, inputs, output)
    check_room(output, _SMALL_BYTES + node.plan.needed_bytes)
    job = Job(
        loaded=run.loaded,
        stage=node.stage.name,
        owner=node.owner,
        settings=node.plan.settings,
        output=output,
        inputs={**inputs, **node.plan.files},
        input_hashes=input_hashes(node.plan, inputs),
        folder=run.folder,
        map=parallel_map,
        threads=run.workers if run.backend == "serial" else 1,
        progress=progress,
        named=tuple(name for name, path in inputs.items() if not _is_own(run, node, name, path)),
    )
    try:
        return node.stage.run(job)
    except (SettingsError, DataError) as error:
        raise _placed(error, run, node) from error


def _is_own(run: Run, node: Node, name: str, path: Path) -> bool:
    """Whether an input is the run folder's own."""
    return path.resolve() == run.path(node.plan.inputs[name]).resolve()


def _placed(error: RobidError, run: Run, node: Node) -> RobidError:
    if str(run.loaded.path) in error.where:
        return error
    section = "" if node.stage.owned_by == "experiment" else f"{node.stage.owned_by}s.{node.owner}"
    own = node.stage.owned_by
    where = "" if error.where == own else error.where.removeprefix(f"{section}.").removeprefix(f"{own}.")
    joint = "." if isinstance(error, SettingsError) and where.startswith(("excitation", "configurations")) else ": "
    return type(error)(
        error.what, where=f"{run.loaded.path}: {section}{joint if where else ''}{where}", remedy=error.remedy
    )
