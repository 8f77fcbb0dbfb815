"""Choice of the numbers of poles and zeros, and of the delay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from robid.models.external.fit.covariance import WHITE
from robid.models.external.fit.output_error import Candidate, Candidates
from robid.models.external.fit.problem import Structure

if TYPE_CHECKING:
    from robid.models.external.fit.data import Shot
    from robid.models.external.fit.options import ExternalOptions
    from robid.models.external.fit.transfer import Hold

_ROUNDS = 4
_IN_A_ROW = 2
_HOPELESS = 0.02  # per sample, difference of the criterion past which nothing is polished
_WEAK = 6.0  # difference of the criterion below which evidence is not strong
STRONG_EVIDENCE = 10.0  # difference of the criterion that is very strong evidence


@dataclass(frozen=True)
class Choice:
    """What structure was chosen, and why."""

    structure: Structure
    best: Candidate  # its fit
    tried: tuple[Candidate, ...]  # all structures tried, by delay, poles and zeros
    reason: str  # why this one, a sentence
    messages: tuple[str, ...]  # what to know about the choice, sentences with remedies


def choose_structure(
    shots: Sequence[Shot],
    inputs: Sequence[int],
    outputs: Sequence[int],
    options: ExternalOptions,
    choose_on: Sequence[Shot] = (),
    *,
    hold: Hold = "zoh",
) -> Choice:
    """Chooses the numbers of poles and zeros and the delay of a block; `sufficient` judges on shots held back.

    The delay is found with the richest structure, then the structure at this delay, and both in turn until they stay.

    Source:
        Oliveira et al. (2019), sec. 2.4, for the rule `sufficient`; Schwarz (1978), "Estimating the dimension of a
        model", for `evidence`, and Kass and Raftery (1995), "Bayes factors", for what is strong.
    """
    common = Structure(1, 0, 0, options.moving_average, hold, options.static_gain == "one", options.stable)
    hopeless = _HOPELESS * sum(shot.outputs.shape[0] for shot in shots) * len(outputs)
    candidates = Candidates(
        shots, inputs, outputs, common, choose_on, hopeless if options.rule == "evidence" else np.inf
    )
    searched = list(range(options.max_delay_samples + 1))
    delays = searched if options.delay_samples is None else [options.delay_samples]
    orders = _orders(options)
    best = _in_turn(candidates, orders, delays, hopeless, options)
    if options.rule == "evidence":
        best = _look_about(candidates, orders, best, options)
        # The fewest poles, at a delay of their own, against which there is no strong evidence.
        for order in (each for each in orders if each[0] < best.structure.poles):
            _nearby(candidates, candidates.fit(*order, best.structure.delay_samples), delays, hopeless)
        even = [each for each in candidates.tried if each.bic <= best.bic + _WEAK]
        best = min(even, key=lambda each: (each.structure.poles, each.bic))
    messages = _about_delay(candidates, best, delays) + _about_order(best, options)
    return Choice(best.structure, best, candidates.tried, _reason(best, options, len(choose_on)), messages)


def _in_turn(
    candidates: Candidates,
    orders: Sequence[tuple[int, int]],
    delays: Sequence[int],
    hopeless: float,
    options: ExternalOptions,
) -> Candidate:
    """Chooses the delay with the richest structure, then structure and delay in turn until they stay."""
    # Zeros of a rich structure stand in for delay; the longest that explains as much leaves them the least to do.
    rich = [candidates.fit(*orders[-1], each) for each in delays]
    near = min(one.bic for one in rich) + STRONG_EVIDENCE
    delay = max(each.structure.delay_samples for each in rich if each.bic <= near)
    for _ in range(_ROUNDS):
        best = _select(candidates, orders, delay, options)
        again = _nearby(candidates, best, delays, hopeless)
        if again == delay:
            break
        delay = again
    return best


def _order(candidate: Candidate) -> tuple[int, int]:
    return candidate.structure.poles, candidate.structure.zeros


def _nearby(candidates: Candidates, best: Candidate, delays: Sequence[int], hopeless: float) -> int:
    """Returns the best delay of a structure, looked for on both sides until two in a row are hopeless."""
    first = delays.index(best.structure.delay_samples)
    for side in (delays[first + 1 :], delays[:first][::-1]):
        bad = 0
        for delay in side:
            there = candidates.fit(*_order(best), delay)
            best = min(best, there, key=lambda each: each.bic)
            bad = bad + 1 if there.bic > best.bic + hopeless else 0
            if bad == _IN_A_ROW:
                break
    return best.structure.delay_samples


def _look_about(
    candidates: Candidates, orders: Sequence[tuple[int, int]], best: Candidate, options: ExternalOptions
) -> Candidate:
    """Tries simpler structures at other delays that explain the data as well: zeros may have stood in for delay."""
    seen = {best.structure.delay_samples}
    while alike := _delays_alike(candidates) - seen:
        for delay in sorted(alike):
            simpler = [order for order in orders if order[0] <= best.structure.poles]
            best = min(best, _select(candidates, simpler, delay, options), key=lambda each: each.bic)
        seen |= alike
    return best


def _delays_alike(candidates: Candidates) -> set[int]:
    """Returns the delays at which some structure explains the data about as well as at any other."""
    found = set()
    for order in {_order(each) for each in candidates.tried}:
        fits = [each for each in candidates.tried if _order(each) == order]
        least = min(each.bic for each in fits)
        if len(fits) > 1:
            found |= {each.structure.delay_samples for each in fits if each.bic < least + STRONG_EVIDENCE}
    return found


def _orders(options: ExternalOptions) -> list[tuple[int, int]]:
    """Numbers of poles and zeros to try, the last the richest; more zeros first, from which fewer are started."""
    poles = [options.poles] if options.poles is not None else range(1, options.max_poles + 1)
    found = []
    for count in poles:
        zeros = [options.zeros] if options.zeros is not None else range(count - 1, -1, -1)
        found += [(count, each) for each in zeros if each < count]
    return sorted(found)


def _select(
    candidates: Candidates, orders: Sequence[tuple[int, int]], delay: int, options: ExternalOptions
) -> Candidate:
    descending = sorted(orders, key=lambda order: (order[0], -order[1]))
    if options.rule == "evidence" or len(orders) == 1:
        return min((candidates.fit(*order, delay) for order in descending), key=lambda each: each.bic)
    tried: list[Candidate] = []
    for count in sorted({order[0] for order in orders}):
        fits = [candidates.fit(*order, delay) for order in descending if order[0] == count]
        enough = [each for each in fits if each.nrmse >= options.sufficient_nrmse]
        if enough:
            return min(enough, key=lambda each: each.structure.zeros)
        tried += fits
    return max(tried, key=lambda each: each.nrmse)


def _reason(best: Candidate, options: ExternalOptions, n_held_back: int) -> str:
    structure = best.structure
    chosen = f"{_counted(structure.poles, 'pole')} and {_counted(structure.zeros, 'zero')}"
    if options.poles is not None and options.zeros is not None:
        return f"{chosen} were asked for"
    if options.rule == "sufficient":
        where = f"{_counted(n_held_back, 'shot')} held back" if n_held_back else "the shots of the fit"
        if best.nrmse >= options.sufficient_nrmse:
            return f"{chosen} are the fewest that reach an NRMSE of {options.sufficient_nrmse:g} on {where}"
        return (
            f"{chosen} come nearest to an NRMSE of {options.sufficient_nrmse:g} on {where}, and reach {best.nrmse:.3g}"
        )
    white = "white" if best.whiteness >= WHITE else "coloured"
    return f"{chosen}: strong evidence asks for no more (Bayesian information criterion), {white} residuals"


def _counted(count: int, word: str) -> str:
    return f"{count} {word}{'' if count == 1 else 's'}"


def _about_delay(candidates: Candidates, best: Candidate, delays: Sequence[int]) -> tuple[str, ...]:
    if len(delays) == 1:
        return ()
    structure, told = best.structure, []
    if structure.delay_samples == delays[-1]:
        message = f"the delay found, {_counted(structure.delay_samples, 'sample')}, is the longest searched"
        told.append(f"{message}: raise `max_delay_samples`")
    near = {each.structure.delay_samples for each in candidates.tried if each.bic < best.bic + STRONG_EVIDENCE}
    alike = [str(each) for each in sorted(near - {structure.delay_samples})]
    if alike:
        told.append(
            f"the delay of {_counted(structure.delay_samples, 'sample')} is not determined: {', '.join(alike)} explain"
            " the data about as well; excite higher frequencies, or give `delay_samples`"
        )
    return tuple(told)


def _about_order(best: Candidate, options: ExternalOptions) -> tuple[str, ...]:
    told = []
    nyquist = np.pi / best.model.sampling_period_s
    beyond = int(np.sum(np.abs(best.model.poles) > nyquist))
    if options.poles is not None and beyond:
        told.append(
            f"{_counted(beyond, 'pole')} found above the Nyquist frequency of {nyquist:.4g} rad/s: the rate is too low"
            f" for {_counted(best.structure.poles, 'pole')}; sample faster, or ask for fewer"
        )
    if options.poles is None and best.structure.poles == options.max_poles and best.whiteness < WHITE:
        told.append(
            f"even {_counted(best.structure.poles, 'pole')} leave coloured residuals: raise `max_poles`, or look for"
            " what is not linear"
        )
    if options.rule == "sufficient" and best.nrmse < options.sufficient_nrmse:
        told.append("no structure tried is sufficient: raise `max_poles`, or lower `sufficient_nrmse`")
    return tuple(told)
