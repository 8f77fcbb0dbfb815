"""Whether a choice of configurations would come out the same by other data, or other parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.design.configurations.criteria import worth
from robid.design.configurations.information import ConfigurationDesign, Stability, design_configurations
from robid.design.configurations.options import DesignOptions
from robid.design.configurations.visits import Visits, make_visits

_WAYS = 3  # Most ways that realizations are divided


@dataclass(frozen=True)
class Trial:
    """Information (n_conf, n_param, n_param) to choose by, and by which that choice is judged."""

    chosen_by: FloatArray
    judged_by: FloatArray


def halves(n_real: int) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Ways to divide realizations into two halves of at least two each; none with fewer than four."""
    if n_real < 4:
        return []
    size, found = n_real // 2, []
    for partner in range(1, min(_WAYS, n_real - 1) + 1):
        # Round-robin pairing: halves of different ways share few realizations.
        first = tuple(sorted((0, *((partner + step - 1) % (n_real - 1) + 1 for step in range(size - 1)))))
        found.append((first, tuple(index for index in range(n_real) if index not in first)))
    return found


def stability(
    source: str,
    trials: Sequence[Trial],
    design: ConfigurationDesign,
    options: DesignOptions,
    prior: FloatArray | None = None,
    cost: FloatArray | None = None,
    between: FloatArray | None = None,
) -> Stability:
    """Chooses again by the information of each trial, which come from a source; the rest as for the design in question.

    Raises:
        DataError: If a trial's information leaves a combination of parameters unseen.
    """
    kept, efficiency = [], []
    again = partial(design_configurations, prior=prior, cost=cost, between=between)
    given = design.configurations, design.parameter_names, options
    often = np.zeros(len(design.configurations))
    for trial in trials:
        own, other = (again(each, *given) for each in (trial.chosen_by, trial.judged_by))
        kept.append(np.isin(design.chosen, own.chosen).mean())
        often[own.chosen] += 1 / len(trials)
        apart = np.zeros(len(design.parameter_names)) if between is None else between
        visits = make_visits(trial.judged_by[None, :, None], apart**2)
        # By information that it did not choose by: its worth over that of the choice by this information.
        ratio = _worth(own.counts, visits, options, prior) / _worth(other.counts, visits, options, prior)
        efficiency.append(other.efficiency * ratio)
    return Stability(source, np.array(kept), np.array(efficiency), often)


def _worth(counts: IntArray, visits: Visits, options: DesignOptions, prior: FloatArray | None) -> float:
    total = visits.total(counts)[:, 0] + (0.0 if prior is None else prior)
    return float(worth(options.of_information, total))
