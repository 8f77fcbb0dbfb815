"""The seven conclusions of Wernholt and Moberg (2008), sec. 7, each held against our figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import spearmanr

from robid.arrays import BoolArray, FloatArray
from robid.report.numbers import MISSING, percent, significant
from robid.studies.over_individuals import ratio_interval
from robid.studies.settings.elastic import EstimatorChoice
from robid.studies.wernholt2008.figures import Found, Models, shares_differ
from robid.studies.wernholt2008.individuals import Individuals, sizes_of

_HONEST_FACTOR = 3.0
_LEAST_CORRELATION = 0.5
_ALIKE = 0.8
_WORTH_HAVING = 0.9
"""Ratio of errors above which one is no gain over the other."""


@dataclass(frozen=True)
class Claim:
    """One conclusion of the paper."""

    text: str  # What the paper says
    figures: str  # What we found
    reproduced: bool | None  # Whether that bears it out; None where the study lacks an estimator that it needs
    # Whether it is sure over the individuals that it makes no gain worth having; None where none are asked
    refuted: bool | None = None

    @property
    def word(self) -> str:
        """The verdict in a word."""
        if self.reproduced is None:
            return MISSING
        if self.reproduced:
            return "yes"
        return {None: "no", False: "undecided", True: "refuted"}[self.refuted]


def claims(
    found: Found,
    choices: Mapping[str, EstimatorChoice],
    transmission: BoolArray,
    individuals: Individuals | None = None,
) -> tuple[Claim, ...]:
    """Returns the seven conclusions.

    Those about success compare shares of reasonable models, of plain descents where the study has them, as the
    paper's: larger by more than two standard errors bears them out. Those about kinds of parameters compare the
    medians of the predicted standard deviation and of the true error of the best model: both must be larger.

    Where there are individuals, the third to the fifth conclusion are about what estimates are worth: the size of their
    errors, see `_by_errors`.

    Args:
        found: What the study found.
        choices: Its estimators by name.
        transmission (n_param,): Which parameters are those of gearboxes.
        individuals: What the estimators make of several individuals, if there are any.
    """

    def models(estimator: str, weights: str, configurations: str = "all") -> Models | None:
        wanted = estimator, weights, configurations
        for name, one in choices.items():
            if (one.estimator, one.weights, one.configurations) == wanted:
                return found.as_in_paper.get(name)
        return None

    user, optimal = models("lls", "user"), models("lls", "optimal")
    spring, damper = found.of_kind("stiffness"), found.of_kind("damping")
    gears, structure = spring & transmission, spring & ~transmission
    plain = (models("nls", "user"), models("nls", "optimal"))
    phase = _shares("Using phase information improves the estimate.", (user,), (models("llsm", "user"),))
    rough = _shares("Rough user-defined weights work better than the theoretically optimal ones.", (user,), (optimal,))
    easier = _kinds("Gearbox springs are easier to estimate than arm structure springs.", found, gears, structure)
    if individuals is not None and user is not None:
        phase = _smaller(phase, individuals, user, models("llsm", "user"))
        rough = _smaller(rough, individuals, user, optimal)
        easier = _easier(easier, individuals, user.name, found, (gears, structure))
    return (
        _shares("The LLS estimator is superior to the NLS estimator.", (user, optimal), plain),
        _shares("More than one configuration is needed.", (user,), (models("lls", "user", "best"),)),
        phase,
        rough,
        easier,
        _kinds("Springs are easier to identify than dampers.", found, spring, damper),
        _honest("The theoretical uncertainties are a good indication of the parameters' quality.", found),
    )


def _shares(text: str, better: tuple[Models | None, ...], worse: tuple[Models | None, ...]) -> Claim:
    first, second = ([one for one in group if one is not None] for group in (better, worse))
    if len(first) < len(better) or len(second) < len(worse):
        return Claim(text, "not studied", None)
    shares = [float(np.mean(np.concatenate([one.reasonable for one in group]))) for group in (first, second)]
    count = sum(len(one.own_cost) for one in first)
    names = [" and ".join(one.name for one in group) for group in (first, second)]
    figures = f"reasonable: {percent(shares[0])} of {names[0]}, {percent(shares[1])} of {names[1]}"
    costs = [min(float(one.user_cost.min()) for one in group) for group in (first, second)]
    figures += f"; best cost {significant(costs[0])} and {significant(costs[1])}"
    return Claim(text, figures, shares_differ(shares[0], shares[1], count))


def _kinds(text: str, found: Found, easier: BoolArray, harder: BoolArray) -> Claim:
    if not easier.any() or not harder.any():
        return Claim(text, "not studied", None)
    error = true_error(found)
    std, off = ([float(np.median(values[mask])) for mask in (easier, harder)] for values in (found.std, error))
    figures = (
        f"predicted deviation {percent(std[0])} and {percent(std[1])},"
        f" true error {percent(off[0])} and {percent(off[1])} (medians)"
    )
    return Claim(text, figures, std[0] < std[1] and off[0] < off[1])


def _smaller(claim: Claim, individuals: Individuals, better: Models, worse: Models | None) -> Claim:
    """The same by the size of the errors over the individuals, with how much the two estimators err alike."""
    if worse is None:
        return claim
    names = better.name, worse.name
    errors, physical = ([values[name] for name in names] for values in (individuals.error, individuals.physical))
    alike = float(np.median([spearmanr(*rows).statistic for rows in zip(*errors, strict=True)]))
    made = ", as what the model lacks makes most of them" if alike >= _ALIKE else ""
    beside = f"rank correlation of both errors {significant(alike, 2)}{made}"
    return _by_errors(claim, errors, physical, names, beside)


def _easier(
    claim: Claim, individuals: Individuals, name: str, found: Found, kinds: tuple[BoolArray, BoolArray]
) -> Claim:
    """The same by the size of the errors of each kind's springs."""
    if not all(kind.any() for kind in kinds):
        return claim
    every = np.array(found.problem.parameters.names)
    own = [np.isin(individuals.names, every[kind]) for kind in kinds]
    stated = [np.nanmedian(individuals.std[name][:, mask], axis=1) for mask in own]
    errors, physical = ([values[name][:, mask] for mask in own] for values in (individuals.error, individuals.physical))
    beside = f"{name} states deviations of {_percents(stated[0])} and {_percents(stated[1])}"
    return _by_errors(claim, errors, physical, ("gears", "structure"), beside)


def _by_errors(
    claim: Claim, errors: list[FloatArray], physical: list[FloatArray], names: tuple[str, str], beside: str
) -> Claim:
    """Judges a conclusion by the errors that it says to be smaller, over those that it says to be larger.

    It is borne out when the 95 % interval of their ratio over the individuals lies below 1, refuted when it lies above
    what would be worth having; neither when it holds both. Estimates count, as in the paper; those of the springs
    themselves, with what the robot file may have wrong, stand beside.
    """
    low, high = ratio_interval(*map(sizes_of, errors))
    figures = (
        f"{claim.figures}; over {len(errors[0])} individuals an error of {_compared(errors, names)}; {beside};"
        f" with what the robot file may have wrong estimated along {_compared(physical, names)}"
    )
    return Claim(claim.text, figures, high < 1, low > _WORTH_HAVING and not high < 1)


def _compared(errors: list[FloatArray], names: tuple[str, str]) -> str:
    sizes = [sizes_of(each) for each in errors]
    low, high = (significant(end, 2) for end in ratio_interval(*sizes))
    return f"{_percents(sizes[0])} ({names[0]}) and {_percents(sizes[1])} ({names[1]}), {low} to {high} times as large"


def _percents(values: FloatArray) -> str:
    return percent(float(np.exp(np.log(values).mean())))


def _honest(text: str, found: Found) -> Claim:
    error = true_error(found)
    ratio = float(np.median(error / found.std))
    rank = float(spearmanr(error, found.std).statistic)
    figures = (
        f"true error over predicted deviation {significant(ratio)} (median; 0.67 if only noise made it),"
        f" rank correlation {significant(rank)}"
    )
    return Claim(text, figures, 1 / _HONEST_FACTOR <= ratio <= _HONEST_FACTOR and rank >= _LEAST_CORRELATION)


def true_error(found: Found) -> FloatArray:
    """Distance (n_param,) of the best reference model from the truth, as a logarithm."""
    return np.abs(found.best - found.truth)
