"""Fits rational transfer functions to a measured frequency response."""

from __future__ import annotations

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.external.fit.parameters import Root
from robid.models.external.response.choice import Candidate, choose, most_poles
from robid.models.external.response.data import MeasuredResponse
from robid.models.external.response.descent import polish
from robid.models.external.response.evidence import make_evidence, misfit_of, n_parameter, scale_of
from robid.models.external.response.improper import missing_zeros
from robid.models.external.response.lines import Lines, make_lines
from robid.models.external.response.options import ResponseFitOptions
from robid.models.external.response.powers import coefficients_of
from robid.models.external.response.residual import State
from robid.models.external.response.result import RationalFit, Tried
from robid.models.external.response.uncertainty import Spread, find_spread, gain_moves, pole_moves, zero_moves

_NEAR = 14.0  # difference of the score, below which a structure is not excluded
_LEFT_OUT = 3.5  # price of a numerator coefficient in weights, between Akaike's 2 and that of evidence, tuned on trials
_MOST = 8  # structures not excluded that are kept


def fit_response(data: MeasuredResponse, options: ResponseFitOptions | None = None) -> RationalFit:
    """Fits transfer functions with common poles and one delay by maximum likelihood.

    `V = sum |G - B/A exp(-s T)|^2 / sigma^2` over lines and elements, sigma the deviation of a real part, is the
    likelihood of circular errors. The structure is chosen as far as `options` leave it open.

    Args:
        data: The response, with the variance of its error.
        options: What is given.

    Returns:
        The model with the most evidence, its covariance, and every structure tried. Where its cost is significantly
        above the expectation, variances are scaled by their ratio.

    Raises:
        ValueError: If the data or the options cannot be.

    Source:
        Pintelon and Schoukens (2012), "System Identification: A Frequency Domain Approach", ch. 8 and 9.
    """
    options = options or ResponseFitOptions()
    data.check()
    options.check()
    lines = make_lines(data, options.time)
    if options.poles is not None and options.poles > most_poles(lines, options):
        message = f"Option `poles` must not exceed {most_poles(lines, options)} for so few data."
        raise ValueError(message)
    candidates = choose(lines, options)
    best = candidates[0]
    state = polish(lines, best.state, longest=best.longest, stable=options.stable)
    return make_result(lines, state, data, options, candidates)


def make_result(
    lines: Lines,
    state: State,
    data: MeasuredResponse,
    options: ResponseFitOptions,
    candidates: list[Candidate],
) -> RationalFit:
    """Puts together what was found."""
    delayed = candidates[0].delayed
    scale, chance = scale_of(lines, state, delayed=delayed), misfit_of(lines, state, delayed=delayed)[1]
    spread = find_spread(lines, state, delayed=delayed, scale=scale)
    shape = data.response.shape[1:]
    numerator, denominator, root = _in_units(lines, spread)
    zeros = [_roots(lines, *zero_moves(spread, element)) for element in range(lines.n_element)]
    gain, gain_std = (values.reshape(shape) for values in _gains(lines, spread))
    return RationalFit(
        time=options.time,
        numerator=numerator.reshape(*shape, -1),
        denominator=denominator,
        delay_s=state.delay * lines.delay_unit_s,
        delay_std_s=float(np.linalg.norm(root[-1])),
        sampling_period_s=data.sampling_period_s,
        integrators=state.denominator.integrators,
        poles=_roots(lines, *pole_moves(spread)),
        zeros=tuple(tuple(zeros[row * shape[1] + column] for column in range(shape[1])) for row in range(shape[0])),
        gain=gain,
        gain_std=gain_std,
        covariance_root=root,
        reference=lines.reference,
        cost=state.cost,
        degrees_of_freedom=lines.n_row - n_parameter(state, delayed=delayed),
        misfit_chance=chance,
        widened=float(np.sqrt(scale)),
        confidence=options.confidence,
        tried=_tried(lines, candidates),
        lines=lines,
        spread=spread,
        alternatives=_alternatives(lines, candidates, scale),
        missing_zeros=missing_zeros(lines, state, options, candidates[0].longest),
    )


def _alternatives(lines: Lines, candidates: list[Candidate], scale: float) -> tuple[tuple[float, Spread], ...]:
    """Structures that the data do not exclude, by weights exp(-score / 2) with a lower price for coefficients.

    Evidence decides whether a coefficient is left out. How far the response may be off without it is a question of
    prediction, for which evidence asks too much and Akaike's price, which makes intervals a little long, too little.
    """
    best, saved = candidates[0], max(make_evidence(lines).per_coefficient - _LEFT_OUT, 0.0)
    unique = {one.structure: one for one in reversed(candidates)}
    scores = {
        structure: one.score - saved * sum(degree - one.state.denominator.n_pole for degree in one.state.degrees)
        for structure, one in unique.items()
    }
    order = sorted((each for each in unique if each != best.structure), key=lambda each: scores[each])
    near = [best.structure, *(each for each in order[:_MOST] if scores[each] < scores[best.structure] + _NEAR)]
    weights = np.exp([(scores[near[0]] - scores[each]) / 2 for each in near])
    weights /= weights.sum()
    return tuple(
        (float(weight), find_spread(lines, unique[each].state, delayed=unique[each].delayed, scale=scale))
        for weight, each in zip(weights[1:], near[1:], strict=True)
    )


def _gains(lines: Lines, spread: Spread) -> tuple[FloatArray, FloatArray]:
    """Gains at low frequencies (n_element,), integrators apart, and their deviations."""
    # (z - 1) / T is s at low frequencies, and 2 / T times its place in the discrete-time plane here.
    unit = lines.reference if lines.time == "continuous" else 2 / lines.delay_unit_s
    scale = unit**spread.state.denominator.integrators
    found = [gain_moves(spread, element) for element in range(lines.n_element)]
    return (
        np.array([gain for gain, _ in found]) * scale,
        np.array([float(np.linalg.norm(moves)) for _, moves in found]) * scale,
    )


def _in_units(lines: Lines, spread: Spread) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Numerators and denominator in powers of s [rad/s] or z, and the covariance's root in those over the reference."""
    found = coefficients_of(spread, discrete=lines.time == "discrete")
    n_pole, n_power = len(found.denominator) - 1, found.numerator.shape[1]
    root = found.root.copy()
    root[-1] *= lines.delay_unit_s
    above = n_pole - np.arange(n_power - 1.0, -1.0, -1.0)
    return (
        found.numerator * lines.reference**above,
        found.denominator * lines.reference ** np.arange(n_pole + 1.0),
        root,
    )


def _roots(lines: Lines, places: ComplexArray, moves: ComplexArray) -> tuple[Root, ...]:
    """Roots in rad/s, or in z, the slow ones first."""
    own, changes = places * lines.reference, moves * lines.reference
    if lines.time == "discrete":
        own, changes = (1 + places) / (1 - places), moves * (2 / (1 - places) ** 2)[:, None]
    order = sorted(range(len(places)), key=lambda index: (abs(places[index]), places[index].real, places[index].imag))
    return tuple(Root(complex(own[index]), changes[index]) for index in order)


def _tried(lines: Lines, candidates: list[Candidate]) -> tuple[Tried, ...]:
    """What was tried, each structure once."""
    found: dict[object, Tried] = {}
    for one in candidates:
        state = one.state
        own = Tried(
            state.denominator.n_pole,
            state.degrees,
            state.denominator.integrators,
            state.delay * lines.delay_unit_s,
            one.delayed,
            state.cost,
            one.score,
        )
        found.setdefault(one.structure, own)
    return tuple(found.values())
