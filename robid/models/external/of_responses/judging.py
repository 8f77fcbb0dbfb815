"""How far to trust transfer functions that were fitted to a response, by themselves and on other responses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.conclusions import graded_alone, outcome_of
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.judge.plausible import MODEL_ERROR, NRMSE_LIMIT
from robid.models.external.of_responses.agreement import held, relative_errors
from robid.models.external.of_responses.fitting import options_of
from robid.models.external.of_responses.solution import RationalSolution, RationalValidation, Shown
from robid.models.external.response.data import MeasuredResponse, ResponseHold
from robid.models.external.response.fitting import fit_response
from robid.results.finding import Finding, two_digits
from robid.results.grade import Grade

LIMIT = 1 - NRMSE_LIMIT
"""Largest relative error of a model that may be used, as for records."""
_BEYOND = 1.5  # of what is expected


def findings_of(solution: RationalSolution, options: ExternalOptions) -> tuple[Finding, ...]:
    """Returns what of the fit is doubtful, decisive findings first."""
    quality = solution.quality
    found = [
        *_errors(solution, quality.relative_error, np.hypot(quality.relative_noise, MODEL_ERROR), "the fit's own data")
    ]
    found += _orders(solution, options)
    found += _conjugates(solution, options)
    return tuple(sorted(found, key=lambda finding: (not finding.decisive, -finding.strength)))


def assess_rational(solution: RationalSolution, options: ExternalOptions) -> Grade:
    """Grades a fit by itself: it predicts at best."""
    return graded_alone(findings_of(solution, options), solution.estimate.status)


def _errors(solution: RationalSolution, error: FloatArray, expected: FloatArray, where: str) -> Iterator[Finding]:
    worst = int(np.nanargmax(error / np.maximum(expected, LIMIT)))
    name, size, most = solution.transfers.names[worst], float(error[worst]), float(expected[worst])
    if size > max(LIMIT, _BEYOND * most):
        told = f"{name} is off by {size:.1%} of its response on {where}, limit {LIMIT:.0%}"
        yield Finding("model", told, decisive=True, strength=size / LIMIT)
        return
    worst = int(np.nanargmax(error / expected))
    ratio = float(error[worst] / expected[worst])
    if ratio > _BEYOND:
        told = (
            f"{solution.transfers.names[worst]} is off by {ratio:.2g} times what its deviations and a model error of "
            f"{MODEL_ERROR:.0%} explain ({where})"
        )
        yield Finding("model", told, decisive=False, strength=ratio / _BEYOND)


def _orders(solution: RationalSolution, options: ExternalOptions) -> Iterator[Finding]:
    """A chosen order that ends where no more were tried, with a misfit left."""
    for index, name in enumerate(solution.transfers.blocks):
        at_most = options.poles is None and int(solution.transfers.poles[index]) == options.max_poles
        if at_most and solution.quality.widened[index] > 1:
            told = f"{name} has as many poles as were tried, {options.max_poles}, and a misfit: raise `max_poles`"
            yield Finding("model", told, decisive=False, strength=float(solution.quality.widened[index]))


_BETTER = 10.0  # Times the misfit of a response over that of its conjugate, from which it is taken for one
_EXPLAINED = 2.0  # Times what deviations explain, up to which a conjugate counts as explained


def _conjugates(solution: RationalSolution, options: ExternalOptions) -> Iterator[Finding]:
    """Responses that are explained badly, and their conjugates well: their phases have the wrong sign."""
    shown, quality, period = solution.shown, solution.quality, solution.ports.sampling_period_s or None
    for block, name in enumerate(solution.transfers.blocks):
        if not quality.widened[block] > 1:
            continue
        own = solution.transfers.block_of == block
        variance = np.where(shown.known & (shown.measured_std > 0), shown.measured_std, np.inf)[:, own, None] ** 2
        measured = np.where(np.isfinite(variance), shown.measured.conj()[:, own, None], 0.0)
        hold: ResponseHold = "none" if period is None else "zoh"
        turned = fit_response(
            MeasuredResponse(shown.frequency_hz, measured, variance, period, hold), options_of(options, period)
        )
        misfit = turned.cost / max(turned.degrees_of_freedom, 1)
        ratio = float(quality.cost[block]) / max(int(quality.degrees_of_freedom[block]), 1) / misfit
        if misfit < _EXPLAINED and ratio > _BETTER:
            told = (
                f"{name}: the conjugate of the response is explained {two_digits(ratio)} times better: its phase has"
                " the wrong sign, so negate it, or its imaginary part"
            )
            yield Finding("units", told, decisive=True, strength=ratio)


def validate_rational(solution: RationalSolution, frf: Frf, findings: Sequence[Finding] = ()) -> RationalValidation:
    """Validates transfer functions on the response of another campaign.

    Raises:
        DataError: If its channels, its hold or its number of configurations are not those of the fit.
    """
    _check(solution, frf)
    transfers, ports = solution.transfers, solution.ports
    hold = held(frf.frequency_hz, ports)[:, None]
    period = ports.sampling_period_s
    model = np.stack([transfers.response(c, frf.frequency_hz, period) for c in range(len(transfers.names))], axis=1)
    near = np.clip(frf.frequency_hz, *solution.shown.frequency_hz[[0, -1]])
    deviation = np.stack(
        [np.interp(near, solution.shown.frequency_hz, each) for each in solution.shown.model_std.T], axis=1
    )
    places = np.arange(frf.frequency_hz.size)[:, None], transfers.outputs, transfers.inputs
    shown = Shown(
        frequency_hz=frf.frequency_hz,
        measured=frf.known_response[0][places],
        measured_std=np.sqrt(frf.element_variance()[0][places]),
        model=model * hold,
        model_std=deviation,
    )
    error, noise, parameters = relative_errors(shown)
    expected = np.sqrt(noise**2 + parameters**2 + MODEL_ERROR**2)
    failures = tuple(
        f"{name} is off by {one:.1%} of its response, limit {LIMIT:.0%}"
        for name, one, most in zip(transfers.names, error.tolist(), expected.tolist(), strict=True)
        if one > max(LIMIT, _BEYOND * most)
    )
    every = [
        *findings,
        *_mistaken(solution, shown, error),
        *_band(solution, frf),
        *_errors(solution, error, expected, "the validation"),
    ]
    verdict = f"does not predict the response: {'; '.join(failures)}" if failures else _verdict(solution, error)
    return RationalValidation(outcome_of(solution.estimate, every, failures, verdict), shown, error, expected)


_SCALES = (1e3, 180 / np.pi, 2 * np.pi)  # factors between units


def _mistaken(solution: RationalSolution, shown: Shown, error: FloatArray) -> Iterator[Finding]:
    """Wrong signs, units and frequencies of the fit or the validation: with them right, the model predicts."""
    transfers, ports = solution.transfers, solution.ports
    for channel, name in enumerate(transfers.names):
        if not error[channel] > LIMIT:
            continue
        measured, model = shown.measured[:, channel], shown.model[:, channel]
        strength = float(error[channel]) / LIMIT
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = measured / model
        scale = complex(np.nanmedian(ratio.real), np.nanmedian(ratio.imag))
        told = f"{name} is {two_digits(scale.real)} times what the fit's response says, the same at all lines"
        if np.nanmedian(np.abs(ratio - scale)) < LIMIT * abs(scale) and abs(scale.imag) < LIMIT * abs(scale):
            known = any(abs(abs(np.log(abs(scale))) / np.log(each) - 1) < LIMIT for each in _SCALES)
            if abs(scale.real + 1) < LIMIT:
                yield Finding("angle_sign", f"{name} has the opposite sign of the fit's response", True, strength)
            elif known:
                yield Finding("units", told, decisive=True, strength=strength)
        if np.nanmedian(np.abs(ratio - model.conj() / model)) < LIMIT:
            told = f"{name} is the conjugate of what the fit's response says: the phase of one has the wrong sign"
            yield Finding("units", told, decisive=True, strength=strength)
        for factor, words in ((2 * np.pi, "Hz were read as rad/s"), (1 / (2 * np.pi), "rad/s were read as Hz")):
            # Of the lines of one, those that the fit has where the other's are.
            moved = shown.frequency_hz * factor
            inside = (moved >= solution.shown.frequency_hz[0]) & (moved <= solution.shown.frequency_hz[-1])
            there = transfers.response(channel, moved[inside], ports.sampling_period_s) * held(moved[inside], ports)
            off = np.abs(measured[inside] - there) / np.abs(measured[inside])
            if inside.mean() > _TOLD and np.nanmedian(off) < LIMIT:
                yield Finding("units", f"{name} is predicted where {words} in one of both", True, strength)


_TOLD = 0.2  # of the lines


def _verdict(solution: RationalSolution, error: FloatArray) -> str:
    worst = int(np.nanargmax(error))
    return f"predicts the response: off by {error[worst]:.2%} or less ({solution.transfers.names[worst]})"


def _band(solution: RationalSolution, frf: Frf) -> Iterator[Finding]:
    """Lines of the validation beyond those of the fit."""
    low, high = solution.shown.frequency_hz[[0, -1]]
    beyond = (frf.frequency_hz < 0.9 * low) | (frf.frequency_hz > 1.1 * high)
    if beyond.any():
        told = f"{int(beyond.sum())} lines of the validation lie outside the {low:.3g} to {high:.3g} Hz of the fit"
        yield Finding("band", told, decisive=False, strength=1 + float(beyond.mean()))


def _check(solution: RationalSolution, frf: Frf) -> None:
    ports = solution.ports
    told = ""
    if (frf.input_names, frf.output_names) != (ports.inputs, ports.outputs):
        told = f"channels {', '.join((*frf.output_names, *frf.input_names))}"
    elif len(frf.configurations) != 1:
        told = f"{len(frf.configurations)} configurations"
    elif (frf.hold_period_s or 0.0) != ports.sampling_period_s:
        told = "another sampling period"
    if told:
        remedy = "validate on a response of the same channels, sampled alike, in one configuration"
        raise DataError(f"D641 the validation has {told} than the fit", where="validation", remedy=remedy)
