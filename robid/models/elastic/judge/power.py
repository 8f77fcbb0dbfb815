"""How large a defect these data would have shown: the power of the test by which a fit's residual is judged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc
from scipy.stats import norm

from robid.arrays import BoolArray, ComplexArray, FloatArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.elastic.fit.model_error import Expectation, expect, relative_residual
from robid.models.elastic.fit.nuisance.effects import Nuisance
from robid.models.elastic.fit.nuisance.listing import list_nuisances
from robid.models.elastic.fit.nuisance.response import nuisance_columns
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.problem import without_coefficients
from robid.models.elastic.fit.solution import Detectable, ElasticSolution
from robid.models.elastic.fit.uncertainty import influence
from robid.models.elastic.judge.fitted import FittedModel, fitted_model
from robid.models.elastic.judge.grading import FLOOR, share_limit
from robid.models.elastic.judge.ratios import candidates
from robid.robot.description import Robot

POWER = 0.8
"""Probability with which a defect is shown that counts as detectable."""

_START = 1.0
"""Deviation of an internal value from which on a prior is that of a start, and states nothing: a factor of e."""

_HALVINGS = 14  # of the interval in which the smallest amount lies: to a thousandth of it
_FOLLOWED = 1e-3  # of the effect of a defect, what parameters have to leave of it for a residual to ask for it
_LARGEST = 1e3  # deviations known beforehand: a defect that takes more is never shown


@dataclass(frozen=True)
class Elements:
    """The elements of a response as the test of its residual sees them."""

    freedom: FloatArray  # (n_element,) Real degrees of freedom of an element's sum of squares
    known: FloatArray  # (n_element,) Real degrees of freedom behind its variance
    limit: FloatArray  # (n_element,) Ratio of the sum over its expectation above which it counts

    def power(self, noncentrality: FloatArray) -> FloatArray:
        """Probability (n_defect,) that more elements count than of a right model.

        An element's sum of squares is noncentral chi-square where the model lacks something, and over its variance
        noncentral Fisher. How many elements are beyond their limits is a sum of independent trials.

        Args:
            noncentrality (n_element, n_defect): Sum of squares of what a defect leaves in an element, over its
                variance.

        Source:
            Patnaik (1949), The non-central chi-square and F distributions and their applications.
        """
        own, known, limit = self.freedom[:, None], self.known[:, None], self.limit[:, None]
        # Patnaik: a noncentral variable is one of more degrees of freedom with the same mean and variance.
        mean = own + noncentrality
        beyond = fdtrc(mean**2 / (mean + noncentrality), known, limit * own / mean)
        needed = int(len(beyond) * share_limit(len(beyond))) + 1
        # Probabilities of fewer, element by element: what reaches the number needed leaves the rows for good.
        fewer = np.zeros((needed, beyond.shape[1]))
        fewer[0] = 1.0
        for one in beyond:
            leaves = one * fewer
            fewer -= leaves
            fewer[1:] += leaves[:-1]
        return np.asarray(1 - fewer.sum(axis=0))

    def smallest_shown(self, noncentrality: FloatArray, largest: FloatArray, power: float = POWER) -> FloatArray:
        """Smallest amounts (n_defect,) that are shown with a given power; infinite where even the largest is not.

        Args:
            noncentrality (n_element, n_defect): That of an amount of one.
            largest (n_defect,): Largest amounts that are looked at.
            power: The power.
        """

        def is_shown(log_amount: FloatArray) -> BoolArray:
            return np.asarray(self.power(np.exp(2 * log_amount) * noncentrality) >= power)

        high = np.log(largest)
        low = high - 2 * np.log(_LARGEST)
        never, always = ~is_shown(high), is_shown(low)
        # The power rises with the amount: halves of the interval, of all defects at once.
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            shown = is_shown(middle)
            low, high = np.where(shown, low, middle), np.where(shown, middle, high)
        amount = np.where(always, np.asarray(largest) / _LARGEST**2, np.exp(0.5 * (low + high)))
        return np.asarray(np.where(never, np.inf, amount))


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
    effects = _effects(fitted, listed)
    pulls = _noncentrality(fitted, effects.left, expected)
    elements, known = _elements(expected), np.isfinite(expected.ratio(np.ones_like(expected.variance)))
    std = np.array([each.common_std for each in listed])
    amounts = elements.smallest_shown(pulls[known], _LARGEST * std)
    names, causes, units = zip(*((each.name, each.cause, each.unit) for each in listed), strict=True)
    known_to = norm.ppf(0.5 + 0.5 * options.confidence) * std
    lower, upper = (
        np.clip(side * known_to, [each.least for each in listed], [each.most for each in listed]) for side in (-1, 1)
    )
    # What parameters follow to a thousandth of its effect, the residual cannot ask for: that little is of second order.
    tells = effects.curvature > _FOLLOWED**2 * effects.size
    asked = np.divide(effects.slope, effects.curvature, out=np.zeros_like(std), where=tells)
    gain = asked * effects.slope / max(effects.chance, np.finfo(float).tiny)
    return Detectable(names, causes, units, lower, upper, amounts, effects.moves, asked, gain)


def listed_defects(fitted: FittedModel) -> tuple[Nuisance, ...]:
    """What a robot file may have wrong, and explanations of a misfit; but ratios, which are exact or plainly wrong."""
    every = (
        *list_nuisances(fitted.robot, fitted.options),
        *candidates(fitted.robot, fitted.problem.frf, fitted.options),
    )
    return tuple(each for each in every if each.common_std > 0 and each.cause != "gear_ratio")


@dataclass(frozen=True)
class _Effects:
    """What one of each defect does."""

    left: ComplexArray  # (n_conf, n_freq, n_out, n_in, n_defect) What the parameters leave of it, as a residual
    moves: FloatArray  # (n_param, n_defect) How far it moves parameters, which follow it
    slope: FloatArray  # (n_defect,) Half the negative gradient of the cost by its amount, priors of starts left out
    curvature: FloatArray  # (n_defect,) Half the second derivative, the parameters following, likewise
    size: FloatArray  # (n_defect,) The same where parameters follow nothing
    chance: float  # Cost that a random column saves in the mean


def _effects(fitted: FittedModel, listed: tuple[Nuisance, ...]) -> _Effects:
    """Lets the parameters follow each defect, by the fit's own weighted least squares."""
    problem, internal = fitted.problem, fitted.internal
    columns = nuisance_columns(problem, internal, fitted.robot, fitted.options, listed, all_rest=False)
    residual, derivative = problem.linear(internal)
    own = problem.rows(derivative).reshape(-1, internal.size)
    added = problem.rows(columns).reshape(-1, len(listed))
    rest = problem.rows(residual).ravel()
    # With what is known a priori of the parameters, as in the fit.
    prior = 0.5 / problem.parameters.prior_std**2
    moves = np.linalg.lstsq(own.T @ own + np.diag(prior), own.T @ added, rcond=1e-14)[0]
    # What the residual asks for it must ask for by itself: a start that is off pulls, however little, and where noise
    # is far below the assumed model error even that pull would ask for a defect which takes the parameter back to it.
    stated = np.where(problem.parameters.prior_std < _START, prior, 0.0)
    follow = np.linalg.lstsq(own.T @ own + np.diag(stated), own.T @ added, rcond=1e-14)[0]
    freedom = problem.residual_kind.parts * int((problem.weight > 0).sum()) - internal.size
    return _Effects(
        left=columns - derivative @ moves,
        moves=moves,
        slope=added.T @ rest - follow.T @ (own.T @ rest - stated * internal),
        curvature=(added * added).sum(axis=0) - ((own.T @ added) * follow).sum(axis=0),
        size=(added * added).sum(axis=0),
        chance=float(rest @ rest) / max(freedom, 1),
    )


def _noncentrality(fitted: FittedModel, left: ComplexArray, expected: Expectation) -> FloatArray:
    """Noncentrality (n_conf, n_out, n_in, n_defect) of elements' sums of squares by what is left of defects."""
    relative = relative_residual(fitted.problem, left, fitted.problem.model_response(fitted.internal))
    square = np.where(expected.used[..., None], np.abs(relative) ** 2, 0.0) / expected.variance[..., None]
    # As many real degrees of freedom as the sum has stand for what is kept of it, in complex squares.
    scale = np.divide(expected.freedom, expected.kept, out=np.zeros_like(expected.kept), where=expected.kept > 0)
    return np.asarray(scale[..., None] * square.sum(axis=1))


def _elements(expected: Expectation) -> Elements:
    """The elements, each with the limit above which its error is both significant and large enough to count."""
    known = np.isfinite(expected.ratio(np.ones_like(expected.variance)))
    lines = np.maximum(expected.used.sum(axis=1), 1)
    # An error of that level adds its square over the variance to the ratio.
    above = np.where(expected.used, 1 / expected.variance, 0.0).sum(axis=1) / lines
    floor = 1 + expected.bias * FLOOR**2 * above
    limit = np.maximum(expected.limit, floor) / expected.bias
    return Elements(expected.freedom[known], expected.known[known], limit[known])
