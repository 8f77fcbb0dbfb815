"""Describing an artifact."""

from __future__ import annotations

from pathlib import Path

from robid.artifacts.store import inspect_artifact
from robid.commands.output import print_json
from robid.stages.terminal import channel_lines, dataset_table, make_console


def describe_artifact(artifact: Path, *, as_json: bool) -> int:
    """Prints what an artifact holds and how it came about; returns the exit code."""
    found = inspect_artifact(artifact)
    if as_json:
        print_json(found)
        return 0
    out, made = make_console(stderr=False), found["provenance"]
    lines = [
        f"{found['kind']} {found['schema_version']}, content {found['content_sha256']}",
        f"made by {made['stage']} at {made['finished_utc']} with robid {made['versions'].get('robid', 'unknown')}",
        *(f"from {name} {digest}" for name, digest in made["inputs"].items()),
        *(f"{name} = {value}" for name, value in found["attributes"].items()),
        *channel_lines(found["datasets"]),
    ]
    for line in lines:
        out.print(line, markup=False, highlight=False, soft_wrap=True)
    out.print(dataset_table(found["datasets"]))
    return 0
