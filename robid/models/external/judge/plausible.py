"""Transfer functions that cannot be, data that tell too little, and how far to trust a fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from robid.models.conclusions import graded_alone
from robid.models.external.fit.choice import STRONG_EVIDENCE
from robid.models.external.fit.covariance import WHITE
from robid.models.external.fit.data import Agreement
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.fit.solution import ExternalSolution
from robid.results.finding import Finding, two_digits
from robid.results.grade import Grade
from robid.results.scale import SCALES, Scale
from robid.signals.pose import POSE

NRMSE_LIMIT = 0.9
"""Least normalised root mean square of a model that may be used."""

MODEL_ERROR = 0.01
"""Share of the motion that a model of a robot may be off without a finding."""

_BEYOND = 1.5  # of what is expected


def expected_std(found: Agreement, parameter_std: float = 0.0) -> float:
    """Error that noise, parameters and the assumed model error give; NaN where the noise is unknown."""
    return float(np.sqrt(found.noise_std**2 + parameter_std**2 + (MODEL_ERROR * found.motion_std) ** 2))


def excess_findings(found: Sequence[Agreement], expected: Sequence[float]) -> Iterator[Finding]:
    """Yields a finding where an output's error is beyond what is expected of it."""
    ratio = np.nan_to_num([one.error_std / each for one, each in zip(found, expected, strict=True)])
    worst = int(np.argmax(ratio))
    if ratio[worst] > _BEYOND:
        told = (
            f"{found[worst].output} is off by {ratio[worst]:.2g} times what noise and a model error of "
            f"{MODEL_ERROR:.0%} of the motion explain ({found[worst].place})"
        )
        yield Finding("model", told, decisive=False, strength=float(ratio[worst]) / _BEYOND)


_FAR, _TOO_FAR = 1.25, 3.0
_CAUSES = {"quantised": "excitation", "stuck": "saturation", "mixed": "coupling", "unsteady": "unsteady"}
_MISTAKES = {
    ("1000", True): "metres were read as millimetres",
    ("1000", False): "millimetres were read as metres",
    ("180/pi", True): "radians were read as degrees",
    ("180/pi", False): "degrees were read as radians",
}
"""What was read as what where commands are, of their own size, too small (True) or too large against motions."""

_ROUGHLY = 1.3
_TILTED = "; poses that were logged in another frame than the tool's at home are turned by `pose`"
_RINGING = 0.1  # time constants


def solution_findings(solution: ExternalSolution, options: ExternalOptions) -> tuple[Finding, ...]:
    """Returns what of an external fit cannot be or is hardly known, decisive findings first."""
    found = [
        *_signals(solution),
        *_unexplained(solution),
        *_gains(solution),
        *_never_settling(solution),
        *_drifting(solution),
        *_delays(solution, options),
        *_orders(solution, options),
        *_coupling(solution),
    ]
    return tuple(sorted(found, key=lambda finding: (not finding.decisive, -finding.strength)))


def _signals(solution: ExternalSolution) -> Iterator[Finding]:
    for finding in solution.findings:
        if finding.kind != "left_out":
            told = f"{finding.channel}: {finding.message}"
            yield Finding(_CAUSES[finding.kind], told, finding.decisive, finding.strength)


def _unexplained(solution: ExternalSolution) -> Iterator[Finding]:
    found = solution.agreements
    worst = min(found, key=lambda one: one.nrmse)
    if worst.nrmse < NRMSE_LIMIT:
        told = (
            f"{worst.output} is described with an NRMSE of {worst.nrmse:.3g} on the fit's own motion `{worst.place}`, "
            f"limit {NRMSE_LIMIT:g}"
        )
        yield Finding("model", told, decisive=True, strength=(1 - worst.nrmse) / (1 - NRMSE_LIMIT))
    else:
        yield from excess_findings(found, [expected_std(one) for one in found])


def _gains(solution: ExternalSolution) -> Iterator[Finding]:
    """Static gains of a position to itself that are far from one: units where a known factor gives them, or a sign."""
    own, ports = solution.transfers, solution.ports
    for channel, name in enumerate(own.names):
        one, other = int(own.inputs[channel]), int(own.outputs[channel])
        gained = f"{name}.gain"
        if gained not in solution.estimate.names:  # an integrator, which comes to rest nowhere
            continue
        index = solution.estimate.names.index(gained)
        known = bool(solution.estimate.identifiable[index])
        if (
            ports.inputs[one] != ports.outputs[other]
            or ports.input_units[one] != ports.output_units[other]
            or not known
            or not solution.transfer(int(own.block_of[channel])).is_stable  # comes to rest nowhere
        ):
            continue
        gain = float(solution.estimate.value[index])
        tilted = _TILTED if ports.outputs[other] in POSE else ""
        if gain < 0:
            told = f"{name} moves against its command (static gain {two_digits(gain)}){tilted}"
            yield Finding("angle_sign", told, decisive=True, strength=10.0)
        elif not 1 / _FAR < gain < _FAR:
            size = abs(np.log(gain))
            found = _read_as(gain)
            as_if = f", as if, in one of both, {_MISTAKES[found.factor, found.inverse]}" if found else tilted
            told = f"{name} comes to rest at {two_digits(gain)} times its command{as_if}"
            decisive, strength = bool(size > np.log(_TOO_FAR)), float(size / np.log(_FAR))
            scales = (found, replace(found, channel="position", inverse=not found.inverse)) if found else ()
            yield Finding("units" if found else "model", told, decisive, strength, scales)


def _read_as(gain: float) -> Scale | None:
    """The wrong scale of commands that gives about this static gain; none where no known one does."""
    for factor, inverse in _MISTAKES:
        known = SCALES[factor] ** (1 if inverse else -1)
        if 1 / _ROUGHLY < gain / known < _ROUGHLY:
            return Scale("command", factor, inverse)
    return None


def _never_settling(solution: ExternalSolution) -> Iterator[Finding]:
    """Unstable poles, and pairs that ring for much longer than any shot lasts: they follow from an unexcited line."""
    longest_s = float(solution.traces.time_s.max())
    for block, name in enumerate(solution.transfers.blocks):
        model = solution.transfer(block)
        if not model.is_stable:
            told = f"{name} has a pole in the right half plane, which a loop that keeps its position cannot have"
            yield Finding("model", told, decisive=True, strength=3.0)
        ringing = model.poles[(model.poles.imag > 0) & (np.abs(model.poles.real) * longest_s < _RINGING)]
        if ringing.size:
            told = f"{name} has poles that never stop ringing, at {ringing.imag[0] / (2 * np.pi):.3g} Hz"
            yield Finding("model", told, decisive=True, strength=2.0)


def _delays(solution: ExternalSolution, options: ExternalOptions) -> Iterator[Finding]:
    own = solution.transfers
    late = [
        name
        for name, delay, searched in zip(own.blocks, own.delay_samples, own.delay_estimated, strict=True)
        if searched and delay == options.max_delay_samples
    ]
    if late:
        told = (
            f"the delay of {', '.join(late)} is the longest that was searched, {options.max_delay_samples} samples: "
            "raise `max_delay_samples`"
        )
        yield Finding("delay", told, decisive=False, strength=2.0)
    open_ = [name for name in own.blocks if _is_open(solution, name)]
    if open_:
        told = f"other delays explain {', '.join(open_)} about as well, with other zeros"
        yield Finding("delay", told, decisive=False, strength=1.5)


def _orders(solution: ExternalSolution, options: ExternalOptions) -> Iterator[Finding]:
    """Orders that are the largest that were tried, where the residual still holds what a model could."""
    own, quality = solution.transfers, solution.quality
    short = [
        name
        for name, poles, chance in zip(own.blocks, own.poles, quality.whiteness_p, strict=True)
        if poles == options.max_poles and chance < WHITE
    ]
    if short and options.poles is None and options.rule == "evidence":
        told = (
            f"{', '.join(short)} took all of `max_poles` ({options.max_poles}), and more than noise is left: "
            "raise it, or take `rule: sufficient` where that is friction"
        )
        yield Finding("model", told, decisive=False, strength=1.5)


def _is_open(solution: ExternalSolution, block: str) -> bool:
    """Whether other delays explain a block about as well with as many poles and zeros."""
    own = [one for one in solution.tried if one.block == block]
    chosen = next(one for one in own if one.chosen)
    return any(
        (one.poles, one.zeros) == (chosen.poles, chosen.zeros)
        and one.delay_samples != chosen.delay_samples
        and one.bic < chosen.bic + STRONG_EVIDENCE
        for one in own
    )


def _drifting(solution: ExternalSolution) -> Iterator[Finding]:
    """Real poles far slower than any shot, and a gain that no position loop has: they follow from what is no motion."""
    own, ports = solution.transfers, solution.ports
    longest_s = float(solution.traces.time_s.max())
    for channel, name in enumerate(own.names):
        one, other = int(own.inputs[channel]), int(own.outputs[channel])
        model = solution.transfer(int(own.block_of[channel]))
        slowest = np.abs(model.poles[model.poles.imag == 0].real).min(initial=np.inf)
        gain = abs(float(own.numerator[channel, -1] / model.denominator[-1])) if model.denominator[-1] else np.inf
        alike = ports.inputs[one] == ports.outputs[other] and ports.input_units[one] == ports.output_units[other]
        slow = slowest * longest_s < _RINGING or solution.integrators(int(own.block_of[channel])) > 0
        if alike and slow and not 1 / _TOO_FAR < gain < _TOO_FAR:
            told = f"{name} has a pole that is too slow for its data, as of a log that drifts or has not settled"
            yield Finding("model", told, decisive=True, strength=2.0)


def _coupling(solution: ExternalSolution) -> Iterator[Finding]:
    """Outputs that follow commands which are not in their model, in the band of the fit."""
    ports, own = solution.ports, solution.transfers
    modelled = {(int(out), int(told)) for out, told in zip(own.outputs, own.inputs, strict=True)}
    fitted = {out for out, _ in modelled}
    missed = [
        (out, told)
        for out, told in np.argwhere(solution.coupling.coupled.any(axis=0)).tolist()
        if out in fitted and (out, told) not in modelled
    ]
    if missed:
        listed = ", ".join(f"{ports.outputs[out]} follows {ports.inputs[told]}" for out, told in missed[:4])
        more = f" and {len(missed) - 4} more" if len(missed) > 4 else ""
        worst = max(float(np.nanmax(solution.coupling.ratio[:, out, told])) for out, told in missed)
        told_so = f"channels are coupled: {listed}{more}; decoupled up to {solution.coupling.overall_hz:.3g} Hz only"
        yield Finding("coupling", told_so, decisive=False, strength=1 + worst)


def assess_external(solution: ExternalSolution, options: ExternalOptions) -> Grade:
    """Gathers the findings about an external fit and grades it by itself: it predicts at best."""
    return graded_alone(solution_findings(solution, options), solution.estimate.status)
