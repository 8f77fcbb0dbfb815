"""The node that a command is about, and what it reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from robid.artifacts.store import read_header
from robid.errors import ArtifactError, SettingsError
from robid.pipeline.chain import STAGES
from robid.pipeline.freshness import State, state_of_output
from robid.pipeline.graph import Node, Run, examine, graph, needed_for
from robid.pipeline.replacing import outputs_at


def choose_node(run: Run, stage_name: str, owner: str | None, option: str = "") -> Node:
    """Finds the node of a command.

    Args:
        run: The run.
        stage_name: Its stage.
        owner: Its campaign, design or fit; None for the only one.
        option: How the command names that, where it is not by the usual option.

    Raises:
        SettingsError: If the owner is unknown, or is not named and there is more than one.
    """
    nodes = [node for node in graph(run.loaded) if node.stage.name == stage_name]
    stage = next(stage for stage in STAGES if stage.name == stage_name)
    known = ", ".join(f"`{node.owner}`" for node in nodes) or "none"
    given = f"with --{stage.owned_by}"
    if owner is None and len(nodes) == 1:
        return nodes[0]
    for node in nodes:
        if node.owner == owner:
            return node
    what = f"`{stage_name}` has no {stage.owned_by} `{owner}`" if owner else f"`{stage_name}` needs --{stage.owned_by}"
    raise SettingsError(
        f"S007 {what}; there are: {known}", where=str(run.loaded.path), remedy=f"name one of them {option or given}"
    )


def require_inputs(run: Run, node: Node, named: list[Path]) -> dict[str, Path]:
    """Returns where a node's inputs lie.

    Args:
        run: The run.
        node: The node.
        named: Artifacts to read instead of the run folder's; each takes the place of the input of its kind.

    Raises:
        ArtifactError: If one is missing or stale, with the command that makes it.
        SettingsError: If a named one is of a kind that the node does not read.
    """
    instead = {_slot(node, path): path for path in named}
    nodes = graph(run.loaded)
    states = examine(run, nodes)
    makers = {path: other for other in nodes for path in other.plan.outputs}
    for other in needed_for(nodes, [path for name, path in node.plan.inputs.items() if name not in instead]):
        damage = states[other].unreadable
        if damage is not None:
            raise damage
    inputs = {}
    for name, path in node.plan.inputs.items():
        if name in instead:
            inputs[name] = instead[name]
            continue
        maker = makers[path]
        state = states[maker]
        if state.blocked and node.stage.takes_what_is_there:
            continue
        if state.status != "fresh":
            why = f" ({state.why})" if state.why else ""
            there = state.status == "stale" and run.path(maker.output).exists()
            remedy = f"`{run.command(maker)}{' --force' * there}` makes it"
            if not maker.stage.on_request(run.loaded, maker.owner):
                remedy += f"; `robid run {run.loaded.path}{run.in_folder}` makes all that is needed"
            raise ArtifactError(f"A019 The input is {state.status}{why}.", where=str(run.path(path)), remedy=remedy)
        inputs[name] = run.path(path)
    return inputs


def _slot(node: Node, path: Path) -> str:
    """Name of the input whose place an artifact takes, by its kind."""
    name = "truth" if path.suffix == ".json" else read_header(path).kind
    if name not in node.plan.inputs:
        raise SettingsError(
            f"S008 `{node.stage.name}` reads no {name}",
            where=f"--input {path}",
            remedy=f"it reads: {', '.join(node.plan.inputs) or 'no artifact'}",
        )
    return name


def fresh_at(node: Node, inputs: Mapping[str, Path], output: Path) -> State:
    """Tells whether a file would come out the same if the node's stage wrote it from these inputs."""
    named = {name: str(path) for name, path in inputs.items()}
    moved = replace(node.plan, outputs=tuple(map(str, outputs_at(node.plan, output))), inputs=named)
    return state_of_output(node.stage, moved, Path(), {str(path): State("fresh") for path in inputs.values()})
