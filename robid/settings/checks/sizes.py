"""What an experiment asks for too many of, by arithmetic alone: nothing is laid out before it is known to be few."""

from __future__ import annotations

import math

from robid.settings.checks.configurations import configuration_count, count_of
from robid.settings.experiment import Campaign, Configurations, Experiment
from robid.settings.problems import Found
from robid.settings.yaml import FieldPath

MOST_CONFIGURATIONS = 20_000  # each is a task with a file of its own
MOST_LOGS = 100_000  # files, each of which is looked for
MOST_EXPERIMENTS = 1_000_000  # of all configurations together


def check_counts(experiment: Experiment, name: str, campaign: Campaign) -> Found:
    """Yields counts of a campaign that are too large together, at the setting that has most part in them."""
    field = ("campaigns", name)
    n_conf = configuration_count(experiment, campaign) or 1
    if n_conf > MOST_CONFIGURATIONS and campaign.configurations is not None:
        place = (*field, "configurations", *_largest(experiment, campaign.configurations))
        yield place, f"S596 makes {_shown(n_conf)} configurations; there may be {_shown(MOST_CONFIGURATIONS)}"
        return
    acquire = None if campaign.source is None else campaign.source.acquire
    counts = {"configurations": n_conf, "realizations": campaign.realizations, "experiments": campaign.experiments or 1}
    most, what = (MOST_EXPERIMENTS, "experiments") if acquire is None else (MOST_LOGS, "logs")
    total = math.prod(counts.values())
    if total > most:
        told = " x ".join(f"{count} {key}" for key, count in counts.items())
        yield (
            (*field, max(counts, key=lambda key: counts[key])),
            f"S597 {told} are {_shown(total)} {what}; there may be {_shown(most)}",
        )


def _largest(experiment: Experiment, chosen: Configurations) -> FieldPath:
    """The part of a choice that has most configurations."""
    if chosen.random is not None:
        return ("random", "count")
    if chosen.join is None:
        return (chosen.key,)
    sizes = [count_of(experiment, part) or 0 for part in chosen.join]
    place = sizes.index(max(sizes))
    return ("join", place, *_largest(experiment, chosen.join[place]))


def _shown(count: int) -> str:
    return f"{count:,}" if count < 10**9 else f"{count:.3g}"
