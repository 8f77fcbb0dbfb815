"""Everything that speaks against a fit, from its data, its parameters and its residual."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import takewhile

from robid.frf.frf import Frf
from robid.models.elastic.fit.fitting import without_coefficients
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.judge.carried import fitted_carrier
from robid.models.elastic.judge.causes import misfit_doubts
from robid.models.elastic.judge.common_factor import common_factor_doubts
from robid.models.elastic.judge.fitted import fitted_model
from robid.models.elastic.judge.grading import grade_fit, is_unexplained
from robid.models.elastic.judge.measures import measure
from robid.models.elastic.judge.plausible_parameters import parameter_doubts
from robid.models.elastic.judge.uncoupled import uncoupled_doubts
from robid.results.doubt import Doubt
from robid.results.estimate import Estimate
from robid.results.grade import Grade, ordered
from robid.results.plausible.doubts import data_doubts
from robid.robot.description import Robot


def assess_fit(robot: Robot, solution: ElasticSolution, frf: Frf, options: ElasticOptions, delay_s: float) -> Grade:
    """Gathers the doubts about a fit and grades it by itself.

    Where units or other scales are wrong, nothing else is looked for: all of it would be their doing.

    Else first to blame is what data alone decide, then a delay, which a fit reads from the phases, then what explains
    the residual, then the rest: parameters that cannot be are mostly the residual's doing. Causes of the residual are
    looked for only where it holds more than noise explains.

    The fit's own data are held to the limits of a validation. Responses or resonances beyond them are a decisive
    doubt, which a validation takes over. What the error costs decides only here: where new data are predicted within
    the limit, a residual that costs more is one reason for doubt among others.

    Args:
        robot: The robot file that the fit started from, with its campaign's payload.
        solution: What the fit found.
        frf: The response that it was fitted to.
        options: Options of the fit.
        delay_s: Nominal delay of the fit, hold excluded [s].

    Returns:
        The grade of the fit alone; with a validation, `grade_validation` takes its doubts.
    """
    seen = _data_doubts(robot, solution.estimate, frf, delay_s)
    if not any(doubt.scales for doubt in seen):
        seen = (*common_factor_doubts(robot, frf, solution.estimate), *seen)
    if any(doubt.scales for doubt in seen):
        return grade_fit(solution, ordered(seen))
    band_hz = float(frf.frequency_hz[0]), float(frf.frequency_hz[-1])
    differenced = any(one.quantity == "speed" and "difference" in one.sampled for one in frf.measured_channels)
    read = parameter_doubts(
        robot, solution.estimate, band_hz, frf.sampling_period_s, options.prior_decades, differenced=differenced
    )
    timing = [doubt for doubt in read if doubt.cause in ("delay", "samples")]
    doubts = [doubt for doubt in seen if doubt.decisive] + timing
    used = frf if options.correct_torques else without_coefficients(frf)
    fitted = fitted_model(robot, solution, used, options, delay_s)
    if is_unexplained(solution):
        doubts += misfit_doubts(robot, solution, fitted, options)
    doubts += uncoupled_doubts(fitted)
    own = measure(fitted, fitted.problem.model_response(fitted.internal), options.weights.model_error)
    missed = own.doubts("the fit's own data")
    return grade_fit(solution, ordered([*doubts, *seen, *read, *missed]), own.cost_failures("the fit's own data"))


def validation_doubts(
    doubts: Sequence[Doubt], robot: Robot, estimate: Estimate, frf: Frf, campaign: str, delay_s: float = 0.0
) -> tuple[Doubt, ...]:
    """Adds what a validation campaign's data contradict to the doubts about a fit.

    What the data of either campaign decide is to blame first.

    Args:
        doubts: Doubts about the fit, the first to blame first.
        robot: The robot file that the fit started from, with the validation campaign's payload.
        estimate: What the fit found: with masses or counterbalances that it freed, weight is carried otherwise.
        frf: The response of the validation campaign.
        campaign: Its name.
        delay_s: Nominal delay from recorded to applied torque, hold excluded [s].
    """
    found = _data_doubts(robot, estimate, frf, delay_s)
    seen = [replace(doubt, message=f"in campaign {campaign}, {doubt.message}") for doubt in found]
    first = takewhile(lambda doubt: doubt.decisive, doubts)
    return ordered([*first, *(doubt for doubt in seen if doubt.decisive), *doubts, *seen])


def _data_doubts(robot: Robot, estimate: Estimate, frf: Frf, delay_s: float) -> tuple[Doubt, ...]:
    """What data contradict, mean torques held against the robot with what the fit freed."""
    return data_doubts(robot, frf, delay_s, fitted_carrier(robot, estimate))
