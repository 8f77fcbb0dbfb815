"""What the report of an elastic fit is made of, as plain values."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from robid.arrays import ComplexArray
from robid.frf.frf import Frf
from robid.report.costs import CostRow, StartRow
from robid.report.parameters import Estimates


@dataclass(frozen=True)
class GradeRow:
    """How far to trust a fit.

    Attributes:
        value: 2 to trust, 1 predicts but single parameters may be off, 0 not to be used.
        sentence: The grade and why it is no better.
        doubts: Everything that speaks against the fit with its likely cause, a clause each.
    """

    value: int
    sentence: str
    doubts: tuple[str, ...] = ()


@dataclass(frozen=True)
class ElementErrors:
    """What the residuals of the response's elements hold beyond their covariance.

    Attributes:
        share_above: Share of the elements whose cost is above its 95 % band.
        share_correlated: Share of the elements whose residuals are correlated over frequency beyond that band.
        median_level: Median relative model error of the elements above their band; 0 without any.
    """

    share_above: float
    share_correlated: float
    median_level: float


@dataclass(frozen=True)
class RepeatRow:
    """A resonance in several measurements of one robot configuration.

    Attributes:
        campaigns: Campaign of each measurement that shows it.
        lowest_hz: Lowest measured peak or dip [Hz].
        highest_hz: Highest one [Hz].
        peak_hz: Their mean [Hz].
        peak_interval_hz: Where another measurement's would be found [Hz].
        pole_hz: Mean pole or zero of the local models [Hz], or None.
        pole_interval_hz: Where another measurement's would be found [Hz], or None.
    """

    campaigns: tuple[str, ...]
    lowest_hz: float
    highest_hz: float
    peak_hz: float
    peak_interval_hz: tuple[float, float]
    pole_hz: float | None = None
    pole_interval_hz: tuple[float, float] | None = None


@dataclass(frozen=True)
class ResonanceRow:
    """One resonance or antiresonance of one channel, measured against the model: peaks, and poles.

    Attributes:
        configuration: Index of the configuration in the estimation campaign.
        channel: Name of the channel.
        kind: Peak or dip of the magnitude.
        measured_hz: Measured peak or dip [Hz], or None when the data show none.
        model_hz: The model's, read from its curve as the measured one [Hz], or None when it has none.
        interval_hz: Lower and upper end of the measured one's interval [Hz], or None.
        mode_hz: The model's own pole or zero there [Hz], or None.
        mode_interval_hz: Lower and upper end of its interval [Hz], or None.
        damping: Its damping ratio, or None.
        pole_hz: Pole or zero of a local model of the measurement [Hz], or None.
        pole_interval_hz: Lower and upper end of its interval [Hz], or None.
        repeat: What all measurements of the configuration show of it, at the first of them; or None.
    """

    configuration: int
    channel: str
    kind: Literal["resonance", "antiresonance"]
    measured_hz: float | None
    model_hz: float | None
    interval_hz: tuple[float, float] | None = None
    mode_hz: float | None = None
    mode_interval_hz: tuple[float, float] | None = None
    damping: float | None = None
    pole_hz: float | None = None
    pole_interval_hz: tuple[float, float] | None = None
    repeat: RepeatRow | None = None


@dataclass(frozen=True)
class DoubtRow:
    """Something that the robot file may have wrong.

    Attributes:
        name: What it is, in one word.
        unit: Unit of its amounts.
        amount: By how much the data say that the file is wrong.
        half_width: Half width of its interval.
        known: Half width of what was known beforehand.
    """

    name: str
    unit: str
    amount: float
    half_width: float
    known: float

    @property
    def is_off(self) -> bool:
        """Whether the interval excludes that the file is right."""
        return abs(self.amount) > self.half_width


@dataclass(frozen=True)
class FitContent:
    """One fit with the data that it explains.

    Attributes:
        name: Name of the fit.
        campaign: Name of the estimation campaign.
        frf: Measured frequency responses.
        model_response (n_conf, n_freq, n_out, n_in): The model's, in the unit of `frf.response`.
        estimates: The parameters.
        resonances: Resonances and antiresonances.
        estimation_costs: Cost per configuration of the fit's own data.
        validation_costs: Cost per configuration of data that the fit never saw.
        starts: The optimizer's starts.
        status: How the fit ended.
        advice: What to do about it; empty when there is nothing to do.
        element_errors: The residuals against their covariance, or None where there is none.
        grade: How far to trust it; None where that is unknown.
        file_doubts: What the robot file may have wrong.
        validation_campaign: Name of the validation campaign.
        validation_frf: Its frequency responses, or None.
        validation_model: The model's responses there, or None.
    """

    name: str
    campaign: str
    frf: Frf
    model_response: ComplexArray
    estimates: Estimates = field(default_factory=Estimates)
    resonances: tuple[ResonanceRow, ...] = ()
    estimation_costs: tuple[CostRow, ...] = ()
    validation_costs: tuple[CostRow, ...] = ()
    starts: tuple[StartRow, ...] = ()
    status: str = ""
    advice: str = ""
    element_errors: ElementErrors | None = None
    grade: GradeRow | None = None
    file_doubts: tuple[DoubtRow, ...] = ()
    validation_campaign: str = ""
    validation_frf: Frf | None = None
    validation_model: ComplexArray | None = None

    @property
    def usable(self) -> bool:
        """Whether nothing says that it must not be used."""
        return self.grade is None or self.grade.value > 0
