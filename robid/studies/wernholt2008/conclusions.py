"""The seven conclusions of Wernholt and Moberg (2008), sec. 7, each held against our figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import spearmanr

from robid.arrays import BoolArray, FloatArray
from robid.report.numbers import percent, significant
from robid.settings.study import EstimatorChoice
from robid.studies.over_individuals import differs
from robid.studies.wernholt2008.figures import Found, Models
from robid.studies.wernholt2008.individuals import Individuals
from robid.validation.starts import shares_differ

_HONEST_FACTOR = 3.0
_LEAST_CORRELATION = 0.5


@dataclass(frozen=True)
class Claim:
    """One conclusion of the paper.

    Attributes:
        text: What the paper says.
        figures: What we found.
        reproduced: Whether that bears it out; None where the study lacks an estimator that it needs.
        refuted: Whether the opposite is sure over the individuals.
    """

    text: str
    figures: str
    reproduced: bool | None
    refuted: bool = False


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

    Where there are individuals, the third and the fourth conclusion are about what estimates are worth: the median
    size of their errors; the fifth about the deviations that fits state and these errors. What is surely smaller over
    the individuals bears it out, what is surely larger refutes it.

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
    if individuals is not None:
        phase = _smaller(phase, individuals, user, models("llsm", "user"))
        rough = _smaller(rough, individuals, user, optimal)
        easier = _easier(easier, individuals, None if user is None else user.name, found, (gears, structure))
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


def _smaller(claim: Claim, individuals: Individuals, better: Models | None, worse: Models | None) -> Claim:
    """The same by the size of the errors over the individuals."""
    if better is None or worse is None:
        return claim
    sizes = [individuals.size(one.name) for one in (better, worse)]
    figures = (
        f"{claim.figures}; over {len(sizes[0])} individuals a median error of {_percents(sizes[0])} of {better.name},"
        f" {_percents(sizes[1])} of {worse.name}, at {significant(float(np.median(individuals.misfit[worse.name])))} of"
        f" the cost that {worse.name} expects"
    )
    smaller, larger = _surely(sizes[0], sizes[1])
    return Claim(claim.text, figures, smaller, larger)


def _easier(
    claim: Claim, individuals: Individuals, name: str | None, found: Found, kinds: tuple[BoolArray, BoolArray]
) -> Claim:
    """The same by the deviations that fits state and by the errors, of each kind's median parameter."""
    if name is None or not all(kind.any() for kind in kinds):
        return claim
    every = np.array(found.problem.parameters.names)
    own = [np.isin(individuals.names, every[kind]) for kind in kinds]
    stated = [np.median(individuals.std[name][:, mask], axis=1) for mask in own]
    # A root mean square: single errors pass through zero.
    error = [np.sqrt((individuals.error[name][:, mask] ** 2).mean(axis=1)) for mask in own]
    figures = (
        f"{claim.figures}; over {len(stated[0])} individuals a stated deviation of {_percents(stated[0])} and"
        f" {_percents(stated[1])}, an error of {_percents(error[0])} and {_percents(error[1])} of {name}"
    )
    verdicts = [_surely(*stated), _surely(*error)]
    return Claim(claim.text, figures, all(one for one, _ in verdicts), any(other for _, other in verdicts))


def _surely(one: FloatArray, other: FloatArray) -> tuple[bool, bool]:
    """Whether figures (n_individual,) are surely smaller than others, and whether they are surely larger."""
    surely = differs(one, other)
    below = float(np.mean(np.log(one / other))) < 0
    return surely and below, surely and not below


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
