"""How large a defect these data would have shown, by the test that judges a residual, and what an unseen one does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import fdtrc, ndtri
from scipy.stats import norm

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.elastic.fit.model_error import Expectation, expect, relative_residual
from robid.models.elastic.fit.nuisance.kinds import Nuisance, list_nuisances
from robid.models.elastic.fit.nuisance.response import nuisance_columns
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.problem import without_coefficients
from robid.models.elastic.fit.solution import Detectable, ElasticSolution
from robid.models.elastic.fit.uncertainty import influence
from robid.models.elastic.judge.fitted import FittedModel, fitted_model
from robid.models.elastic.judge.grading import FLOOR, share_limit
from robid.models.elastic.judge.ratios import candidates
from robid.results.finding import Finding, two_digits
from robid.robot.description import Robot

POWER = 0.8
"""Probability with which a defect is shown that counts as detectable."""

_LARGEST = 1e3  # deviations known beforehand: a defect that takes more is never shown


@dataclass(frozen=True)
class Elements:
    """The elements of a response as the test of its residual sees them."""

    freedom: FloatArray  # (n_element,) Real degrees of freedom of an element's sum of squares
    known: FloatArray  # (n_element,) Real degrees of freedom behind its variance
    limit: FloatArray  # (n_element,) Ratio of the sum over its expectation above which it counts

    def power(self, noncentrality: FloatArray) -> float:
        """Probability that more elements count than of a right model.

        An element's sum of squares is noncentral chi-square where the model lacks something, and over its variance
        noncentral Fisher. How many elements are beyond their limits is a sum of independent trials.

        Args:
            noncentrality (n_element,): Sum of squares of what the defect leaves in an element, over its variance.

        Source:
            Patnaik (1949), The non-central chi-square and F distributions and their applications.
        """
        # Patnaik: a noncentral variable is one of more degrees of freedom with the same mean and variance.
        mean = self.freedom + noncentrality
        freedom = mean**2 / (mean + noncentrality)
        beyond = fdtrc(freedom, self.known, self.limit * self.freedom / mean)
        needed = int(beyond.size * share_limit(beyond.size)) + 1
        # Probabilities of fewer, element by element: what reaches the number needed leaves the vector for good.
        fewer = np.zeros(needed)
        fewer[0] = 1.0
        for one in beyond.tolist():
            fewer[1:] = (1 - one) * fewer[1:] + one * fewer[:-1]
            fewer[0] *= 1 - one
        return float(1 - fewer.sum())

    def smallest_shown(self, noncentrality: FloatArray, largest: float, power: float = POWER) -> float:
        """Smallest amount that is shown with a given power; infinite where even the largest is not.

        Args:
            noncentrality (n_element,): That of an amount of one.
            largest: Largest amount that is looked at.
            power: The power.
        """

        def short(log_amount: float) -> float:
            return float(ndtri(np.clip(self.power(np.exp(2 * log_amount) * noncentrality), 1e-15, 1 - 1e-15))) - wanted

        wanted, high = float(ndtri(power)), float(np.log(largest))
        low = high - 2 * np.log(_LARGEST)
        if not noncentrality.any() or short(high) <= 0:
            return np.inf
        return float(np.exp(brentq(short, low, high, xtol=5e-3))) if short(low) < 0 else float(np.exp(low))


def detectable_defects(
    robot: Robot, solution: ElasticSolution, frf: Frf, options: ElasticOptions, delay_s: float
) -> Detectable | None:
    """Finds for each listed defect the smallest amount that a fit's residual would have shown, to first order.

    The parameters follow a defect as far as they can; only what they leave of it is seen, against the covariance of the
    response, by the test that decides of a fit: how many elements are beyond their covariance.

    Args:
        robot: The robot file that the fit started from.
        solution: What the fit found.
        frf: The response that it was fitted to.
        options: Options of the fit.
        delay_s: Nominal delay of the fit, hold excluded [s].

    Returns:
        The amounts; None without a covariance, where nothing is listed, or where the fitted robot does not rest.

    Source:
        docs/methods, sec. 11.
    """
    used = frf if options.correct_torques else without_coefficients(frf)
    try:
        fitted = fitted_model(robot, solution, used, options, delay_s)
    except DataError:  # springs under which the robot finds no rest
        return None
    listed = listed_defects(fitted)
    modelled = fitted.problem.model_response(fitted.internal)
    expected = expect(fitted.problem, fitted.internal, influence(fitted.problem, fitted.internal), modelled)
    if expected is None or not listed:
        return None
    pulls, moves = _left_by(fitted, listed, expected)
    elements, known = _elements(expected), np.isfinite(expected.ratio(np.ones_like(expected.variance)))
    std = np.array([each.common_std for each in listed])
    amounts = [
        elements.smallest_shown(pull[known], _LARGEST * one)
        for pull, one in zip(np.moveaxis(pulls, -1, 0), std.tolist(), strict=True)
    ]
    names, causes, units = zip(*((each.name, each.cause, each.unit) for each in listed), strict=True)
    known_to = norm.ppf(0.5 + 0.5 * options.confidence) * std
    lower, upper = (
        np.clip(side * known_to, [each.least for each in listed], [each.most for each in listed]) for side in (-1, 1)
    )
    return Detectable(names, causes, units, lower, upper, np.array(amounts), moves)


def listed_defects(fitted: FittedModel) -> tuple[Nuisance, ...]:
    """What a robot file may have wrong, and explanations of a misfit; but ratios, which are exact or plainly wrong."""
    every = (*list_nuisances(fitted.robot, fitted.options), *candidates(fitted.robot, fitted.problem.frf))
    return tuple(each for each in every if each.common_std > 0 and each.cause != "gear_ratio")


def _left_by(fitted: FittedModel, listed: tuple[Nuisance, ...], expected: Expectation) -> tuple[FloatArray, FloatArray]:
    """What one of each defect leaves of elements, and how far it moves parameters, which follow it.

    Returns:
        Noncentrality (n_conf, n_out, n_in, n_defect), and moves (n_param, n_defect) of the internal parameters.
    """
    problem, internal = fitted.problem, fitted.internal
    columns = nuisance_columns(problem, internal, fitted.robot, fitted.options, listed, all_rest=False)
    derivative, n_defect = problem.linear(internal)[1], columns.shape[-1]
    own = problem.rows(derivative).reshape(-1, internal.size)
    added = problem.rows(columns).reshape(-1, n_defect)
    # The fit's own weighted least squares, with what is known beforehand of its parameters.
    prior = np.diag(0.5 / problem.parameters.prior_std**2)
    moves = np.linalg.lstsq(own.T @ own + prior, own.T @ added, rcond=1e-14)[0]
    left = relative_residual(problem, columns - derivative @ moves, problem.model_response(internal))
    square = np.where(expected.used[..., None], np.abs(left) ** 2, 0.0) / expected.variance[..., None]
    # As many real degrees of freedom as the sum has stand for what is kept of it, in complex squares.
    scale = np.divide(expected.freedom, expected.kept, out=np.zeros_like(expected.kept), where=expected.kept > 0)
    return scale[..., None] * square.sum(axis=1), moves


def _elements(expected: Expectation) -> Elements:
    """The elements, each with the limit above which its error is both significant and large enough to count."""
    known = np.isfinite(expected.ratio(np.ones_like(expected.variance)))
    lines = np.maximum(expected.used.sum(axis=1), 1)
    # An error of that level adds its square over the variance to the ratio.
    above = np.where(expected.used, 1 / expected.variance, 0.0).sum(axis=1) / lines
    floor = 1 + expected.bias * FLOOR**2 * above
    limit = np.maximum(expected.limit, floor) / expected.bias
    return Elements(expected.freedom[known], expected.known[known], limit[known])


_FAR = 1.5
"""Half widths from the middle of an interval beyond which a value is outside: defects act to first order here."""

_QUIETER = 10.0  # times smaller errors than any campaign gives
_GEARS = ("transmission", "bearing")


@dataclass(frozen=True)
class Hidden:
    """A defect that may be there unseen, and what it would have done to a gear or bearing."""

    defect: int  # Its index among the detectable defects
    parameter: int  # Index of the parameter
    amount: float  # How large it may be
    moved: float  # What it would have moved the logarithm of the estimate by
    half_widths: float  # How far the true value would lie from the middle of the physical interval


def worst_hidden(robot: Robot, solution: ElasticSolution) -> Hidden | None:
    """Finds the unseen defect that would put a gear or bearing farthest outside its physical interval.

    A defect may be as large as what is known of it beforehand, what the residual would not have shown, and what its
    estimate along with the parameters leaves open. Where one of these says that none is there, or that one must be
    larger, it is not hidden.

    Args:
        robot: The robot file that the fit started from.
        solution: What the fit found, with what it would have shown.

    Returns:
        The defect, inside its interval or not; None where nothing is known of any.
    """
    found, estimate, doubts = solution.detectable, solution.estimate, solution.doubts
    names = [f"{each.name}.stiffness" for each in robot.springs if each.place in _GEARS]
    rows = [index for index, name in enumerate(estimate.names) if name in names]
    if found is None or doubts is None or not rows:
        return None
    value, lower, upper = (np.log(each[rows]) for each in (estimate.value, estimate.lower, estimate.upper))
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    worst: list[Hidden] = []
    for defect, name in enumerate(found.names):
        if name not in doubts.names:
            continue
        own, shown = doubts.names.index(name), found.amount[defect]
        left = doubts.value[own] + np.array([-1, 1]) * doubts.half_width[own]
        least, most = max(found.lower[defect], -shown, left[0]), min(found.upper[defect], shown, left[1])
        for amount in (least, most) if least <= most else ():
            # What a defect has moved an estimate by, the true value lies back.
            moved = found.moves[rows, defect] * amount
            far = np.abs(value - moved - middle) / half
            at = int(np.argmax(far))
            worst.append(Hidden(defect, rows[at], float(amount), float(moved[at]), float(far[at])))
    return max(worst, key=lambda each: each.half_widths, default=None)


def hidden_findings(robot: Robot, solution: ElasticSolution) -> tuple[Finding, ...]:
    """A finding where a defect that these data do not show may put a gear or bearing outside its physical interval.

    Arguments are as of `worst_hidden`.
    """
    hidden, found = worst_hidden(robot, solution), solution.detectable
    if hidden is None or found is None or hidden.half_widths <= _FAR:
        return ()
    shown, unit = float(found.amount[hidden.defect]), found.units[hidden.defect]
    seen = f"would be seen from {two_digits(shown)} on" if np.isfinite(shown) else "would never be seen"
    quieter = shown / abs(hidden.amount)
    more = (
        f"errors {two_digits(quieter)} times smaller would show it: more torque, or {two_digits(quieter**2)} times as "
        "many realizations; or "
        if 1 < quieter < _QUIETER
        else ""
    )
    message = (
        f"{found.names[hidden.defect]} may be {two_digits(hidden.amount)} {unit} and {seen}; it would have moved "
        f"{solution.estimate.names[hidden.parameter]} by {two_digits(100 * np.expm1(hidden.moved), '+')} %, and the "
        f"true value lay {two_digits(hidden.half_widths)} half-widths from the middle of its interval ({more}measure "
        "configurations that bend it otherwise, or state in `doubts` how well it is known)"
    )
    return (Finding("hidden", message, decisive=False, strength=hidden.half_widths / _FAR),)
