"""Experiments beside the study's own that parts of it read."""

from __future__ import annotations

from dataclasses import replace

from robid.models.files import load_experiment
from robid.pipeline.graph import Run


def run_of(run: Run, experiment: str, folder: str) -> Run:
    """Returns the run of another experiment file, relative to the study's, in a folder of the study's own."""
    return replace(run, loaded=load_experiment(run.loaded.path.parent / experiment), folder=run.folder / folder)


def missing_log(run: Run) -> str:
    """Name of the first log of a run that is not there; empty when all are."""
    folder = run.loaded.path.parent
    for campaign in run.loaded.experiment.campaigns.values():
        if campaign.source is not None and campaign.source.acquire is not None:
            path = campaign.source.acquire.log_path(folder)
            if not path.exists():
                return path.name
    return ""
