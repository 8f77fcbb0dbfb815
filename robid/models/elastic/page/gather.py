"""What the page of a fit shows, as plain values, and how it is gathered from artifacts, resonances among it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from scipy.stats import norm

from robid.arrays import ComplexArray, FloatArray
from robid.artifacts.results import grade_from_artifact
from robid.frf.frf import Frf
from robid.models.elastic.files import (
    new_resonances_from_artifact,
    resonances_from_artifact,
    solution_from_artifact,
    validation_from_artifact,
)
from robid.models.elastic.fit.model_error import ModelError
from robid.models.elastic.fit.nuisance.listing import list_nuisances
from robid.models.elastic.fit.solution import ElasticSolution, NuisanceEstimates, Starts
from robid.models.elastic.judge.middles import MiddleRow, middle_rows
from robid.models.elastic.judge.resonances import Measured, Repeat, ResonanceTable, pool_repeats
from robid.models.elastic.judge.validating import Validation
from robid.models.elastic.page.fitted import FittedViews, fitted_views
from robid.models.elastic.page.gears import GearRow, gear_rows, gear_sentence
from robid.models.elastic.page.known import KnownGears, known_content
from robid.models.elastic.page.middles import middle_sentence
from robid.models.elastic.page.power import PowerRow, power_rows
from robid.models.elastic.settings import elastic_fit
from robid.models.family import Shown
from robid.models.parameters import parameter_rows
from robid.report.costs import CostRow, StartRow
from robid.report.parameters import Estimates, ParameterRow
from robid.results.grade import Grade
from robid.settings.experiment import payload_kg


@dataclass(frozen=True)
class RepeatRow:
    """A resonance in several measurements of one robot configuration."""

    campaigns: tuple[str, ...]  # Campaign of each measurement that shows it
    lowest_hz: float  # Lowest measured peak or dip [Hz]
    highest_hz: float  # Highest one [Hz]
    peak_hz: float  # Their mean [Hz]
    peak_interval_hz: tuple[float, float]  # Where another measurement's would be found [Hz]
    pole_hz: float | None = None  # Mean pole or zero of the local models [Hz], or None
    pole_interval_hz: tuple[float, float] | None = None  # Where another measurement's would be found [Hz], or None


@dataclass(frozen=True)
class ResonanceRow:
    """One resonance or antiresonance of one channel, measured against the model: peaks, and poles."""

    configuration: int  # Index of the configuration in the estimation campaign
    channel: str  # Name of the channel
    kind: Literal["resonance", "antiresonance"]  # Peak or dip of the magnitude
    measured_hz: float | None  # Measured peak or dip [Hz], or None when the data show none
    model_hz: float | None  # The model's, read from its curve as the measured one [Hz], or None when it has none
    interval_hz: tuple[float, float] | None = None  # Lower and upper end of the measured one's interval [Hz], or None
    mode_hz: float | None = None  # The model's own pole or zero there [Hz], or None
    mode_interval_hz: tuple[float, float] | None = None  # Lower and upper end of its interval [Hz], or None
    damping: float | None = None  # Its damping ratio, or None
    pole_hz: float | None = None  # Pole or zero of a local model of the measurement [Hz], or None
    pole_interval_hz: tuple[float, float] | None = None  # Lower and upper end of its interval [Hz], or None
    repeat: RepeatRow | None = None  # What all measurements of the configuration show, at the first of them; or None


@dataclass(frozen=True)
class NuisanceRow:
    """Something that the robot file may have wrong."""

    name: str  # What it is, in one word
    unit: str  # Unit of its amounts
    amount: float  # By how much the data say that the file is wrong
    half_width: float  # Half width of its interval
    known: float  # Half width of what was known beforehand

    @property
    def is_off(self) -> bool:
        """Whether the interval excludes that the file is right."""
        return abs(self.amount) > self.half_width


@dataclass(frozen=True)
class FitContent:
    """One fit with the data that it explains."""

    name: str  # Name of the fit
    campaign: str  # Name of the estimation campaign
    frf: Frf  # Measured frequency responses
    model_response: ComplexArray  # (n_conf, n_freq, n_out, n_in) The model's, in the unit of `frf.response`
    estimates: Estimates = field(default_factory=Estimates)  # The parameters
    resonances: tuple[ResonanceRow, ...] = ()  # Resonances and antiresonances
    estimation_costs: tuple[CostRow, ...] = ()  # Cost per configuration of the fit's own data
    validation_costs: tuple[CostRow, ...] = ()  # Cost per configuration of data that the fit never saw
    starts: tuple[StartRow, ...] = ()  # The optimizer's starts
    status: str = ""  # How the fit ended
    advice: str = ""  # What to do about it; empty when there is nothing to do
    model_error: ModelError | None = None  # The residuals against their covariance, or None where there is none
    grade: Grade | None = None  # How far to trust it; None where that is unknown
    nuisance_rows: tuple[NuisanceRow, ...] = ()  # What the robot file may have wrong
    gears: tuple[GearRow, ...] = ()  # What gears alone may be
    known: KnownGears = field(default_factory=KnownGears)  # What another fit knew of gears beforehand
    middles: tuple[MiddleRow, ...] = ()  # What moves the middles of intervals away from the estimates
    power: tuple[PowerRow, ...] = ()  # How large a defect the residual would have shown
    validation_campaign: str = ""  # Name of the validation campaign
    validation_frf: Frf | None = None  # Its frequency responses, or None
    validation_model: ComplexArray | None = None  # The model's responses there, or None
    views: FittedViews = field(default_factory=FittedViews)  # Its modes, and residuals by line

    @property
    def usable(self) -> bool:
        """Whether nothing says that it must not be used."""
        return self.grade is None or self.grade.value > 0


def resonance_rows(shown: Shown, confidence: float) -> tuple[ResonanceRow, ...]:
    """Returns the resonances of a fit's own data, their intervals widened to what further campaigns scatter."""
    own = _fitted(shown)
    others = [*_validated(shown), *(each for other in shown.beside for each in (_fitted(other), *_validated(other)))]
    table, repeats = pool_repeats(own, [each for each in others if _same_payload(shown, own, each)], confidence)
    return _rows(table, {repeat.row: repeat for repeat in repeats})


def _fitted(shown: Shown) -> Measured:
    data = shown.data
    return Measured(resonances_from_artifact(shown.model), data.response.configurations, data.origins)


def _validated(shown: Shown) -> Iterator[Measured]:
    """Resonances of the campaign that a fit was validated on, if there are some."""
    table = None if shown.validation is None else new_resonances_from_artifact(shown.validation)
    campaign = elastic_fit(shown.data.loaded.experiment, shown.data.name).validate_on
    if table is not None and shown.new is not None and campaign is not None:
        places = shown.new.response.configurations
        yield Measured(table, places, (campaign,) * len(places))


def _same_payload(shown: Shown, own: Measured, other: Measured) -> bool:
    """Whether all campaigns move the same mass: what carries another one is another robot."""
    campaigns, robot = shown.data.loaded.experiment.campaigns, shown.data.loaded.robot
    return len({payload_kg(campaigns[name], robot) for name in (*own.campaigns, *other.campaigns)}) == 1


def _rows(table: ResonanceTable, repeats: dict[int, Repeat]) -> tuple[ResonanceRow, ...]:
    nowhere = np.full(table.measured_hz.size, np.nan)
    pole, low, high = (
        nowhere if values is None else values for values in (table.pole_hz, table.pole_lower_hz, table.pole_upper_hz)
    )
    return tuple(
        ResonanceRow(
            configuration=int(table.configuration[row]),
            channel=channel,
            kind="resonance" if table.kind[row] == "resonance" else "antiresonance",
            measured_hz=float(table.measured_hz[row]),
            model_hz=_finite(table.model_hz[row]),
            interval_hz=_interval(table.lower_hz[row], table.upper_hz[row]),
            mode_hz=_finite(table.mode_hz[row]),
            mode_interval_hz=_interval(table.mode_lower_hz[row], table.mode_upper_hz[row]),
            damping=_finite(table.damping[row]),
            pole_hz=_finite(pole[row]),
            pole_interval_hz=_interval(low[row], high[row]),
            repeat=_repeat_row(repeats[row]) if row in repeats else None,
        )
        for row, channel in enumerate(table.channel)
    )


def _repeat_row(repeat: Repeat) -> RepeatRow:
    low, high = repeat.mean_hz - repeat.half_hz, repeat.mean_hz + repeat.half_hz
    return RepeatRow(
        campaigns=repeat.campaigns,
        lowest_hz=float(repeat.peaks_hz.min()),
        highest_hz=float(repeat.peaks_hz.max()),
        peak_hz=float(repeat.mean_hz[0]),
        peak_interval_hz=(float(low[0]), float(high[0])),
        pole_hz=_finite(repeat.mean_hz[1]),
        pole_interval_hz=_interval(low[1], high[1]),
    )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _interval(lower: float, upper: float) -> tuple[float, float] | None:
    return (float(lower), float(upper)) if np.isfinite([lower, upper]).all() else None


def fit_content(shown: Shown) -> FitContent:
    """Turns a fit, its data and its validation into rows."""
    loaded, frf = shown.data.loaded, shown.data.response
    settings = elastic_fit(loaded.experiment, shown.data.name)
    robot = loaded.robot.to_robot(loaded.experiment.campaigns[settings.campaign].payload_kg)
    solution = solution_from_artifact(shown.model)
    limits = {each.name: (each.least, each.most) for each in list_nuisances(robot, settings.options())}
    estimate = solution.estimate
    validation = None if shown.validation is None else validation_from_artifact(shown.validation)
    grade = grade_from_artifact(shown.model) if validation is None else validation.outcome.grade
    costs = solution.costs.configuration, solution.costs.expected
    content = FitContent(
        name=shown.data.name,
        campaign=" + ".join(settings.campaigns),
        frf=replace(frf, response=solution.responses.measured),
        model_response=solution.responses.modelled,
        estimates=_estimates(solution, frf.input_unit, shown.true, robot.assumed),
        resonances=resonance_rows(shown, estimate.confidence),
        estimation_costs=_costs(" + ".join(settings.campaigns), shown.data.configurations, *costs),
        starts=_starts(solution.starts),
        status=estimate.status.replace("_", " "),
        advice=estimate.advice,
        model_error=solution.model_error,
        nuisance_rows=() if solution.doubts is None else nuisance_rows(solution.doubts, limits, estimate.confidence),
        gears=gear_rows(solution, frf.input_unit),
        known=known_content(shown, estimate),
        middles=middle_rows(solution),
        power=power_rows(solution),
        grade=grade,
        views=fitted_views(shown, solution),
    )
    if validation is None or settings.validate_on is None or shown.new is None:
        return content
    return _with_validation(content, validation, settings.validate_on, shown.new.response)


def _with_validation(content: FitContent, validation: Validation, campaign: str, frf: Frf) -> FitContent:
    every = range(len(validation.cost))
    return replace(
        content,
        validation_costs=_costs(campaign, every, validation.cost, validation.expected_cost),
        validation_campaign=campaign,
        validation_frf=replace(frf, response=validation.measured),
        validation_model=validation.modelled,
    )


def nuisance_rows(
    nuisances: NuisanceEstimates, limits: Mapping[str, tuple[float, float]], confidence: float
) -> tuple[NuisanceRow, ...]:
    """Turns what a fit says of its nuisances into rows; no amount is told that makes no sense, as of a negative mass.

    Args:
        nuisances: What the fit says.
        limits: Least and most amount of each nuisance, by its name; those without any are told as they are.
        confidence: Level of the intervals.
    """
    known = norm.ppf(0.5 + 0.5 * confidence) * np.hypot(nuisances.prior_std, nuisances.place_std)
    told = [
        float(np.clip(value, *limits.get(name, (-np.inf, np.inf))))
        for name, value in zip(nuisances.names, nuisances.value.tolist(), strict=True)
    ]
    columns = nuisances.names, nuisances.units, told, nuisances.half_width.tolist(), known.tolist()
    return tuple(NuisanceRow(*row) for row in zip(*columns, strict=True))


def _starts(starts: Starts) -> tuple[StartRow, ...]:
    ends = zip(
        starts.cost.tolist(),
        starts.iterations.tolist(),
        starts.status,
        starts.minimum.tolist(),
        starts.evaluations.tolist(),
        strict=True,
    )
    return tuple(StartRow(index, *end) for index, end in enumerate(ends))


def _estimates(
    solution: ElasticSolution, torque_unit: str, truth: Mapping[str, float], assumed: tuple[str, ...]
) -> Estimates:
    found = solution.estimate
    return Estimates(
        rows=_parameters(solution, torque_unit, truth, assumed),
        level=found.confidence,
        torque_unit=torque_unit,
        misfit=solution.misfit,
        undetermined=found.undetermined,
        identifiable_relative_std=found.identifiable_relative_std,
        interval_rule=found.interval_rule,
        covariance=found.covariance,
        about=" ".join(
            filter(None, (gear_sentence(gear_rows(solution, torque_unit)), middle_sentence(middle_rows(solution))))
        ),
    )


def _parameters(
    solution: ElasticSolution, torque_unit: str, truth: Mapping[str, float], assumed: tuple[str, ...]
) -> tuple[ParameterRow, ...]:
    realized, repeated = solution.realization_relative_std, solution.bootstrap
    rows = parameter_rows(solution.estimate, truth, assumed, torque_unit)
    alone = np.zeros(len(rows), bool) if solution.effective is None else solution.effective.untested
    return tuple(
        replace(
            row,
            note="; ".join(
                filter(None, (row.note, "determined by one cluster of configurations" if alone[index] else ""))
            ),
            bootstrap=None if repeated is None else (float(repeated.lower[index]), float(repeated.upper[index])),
            realization_relative_std=None if realized is None else float(realized[index]),
        )
        for index, row in enumerate(rows)
    )


def _costs(campaign: str, indices: Sequence[int], cost: FloatArray, expected: FloatArray) -> tuple[CostRow, ...]:
    return tuple(
        CostRow(campaign, index, value, wanted if wanted > 0 else None, value - wanted if wanted > 0 else None)
        for index, value, wanted in zip(indices, cost.tolist(), expected.tolist(), strict=True)
    )
