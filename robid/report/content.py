"""What a report is made of, as plain values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from robid.arrays import ComplexArray, check_shape
from robid.frf.frf import Frf
from robid.report.section import Section


@dataclass(frozen=True)
class Verdict:
    """The answer in one line.

    Attributes:
        text: One sentence.
        level: `ok` when the result can be used as it is, `warn` when the reader has to look closer, `bad` when it
            must not be used.
    """

    text: str
    level: Literal["ok", "warn", "bad"]


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
class ParameterRow:
    """One parameter of a fit, in SI units.

    Attributes:
        name: Name of the parameter.
        kind: Its kind, as in `stiffness`, `damping`, `delay`.
        unit: Its SI unit, as in `N m/rad`.
        nominal: Value in the robot file; 0 for kind `friction`, whose values are deviations from it.
        estimate: Fitted value.
        lower: Lower end of the interval.
        upper: Upper end of the interval.
        relative_std: Relative standard deviation after the fit.
        truth: True value of a simulated robot, or None.
        identifiable: Whether the data determine the parameter, fixed before the fit.
        identified: Whether that is so and the interval after the fit bears it out.
        predicted_relative_std: Relative deviation predicted before the fit, which decides; None where it is unknown.
        known_relative_std: Relative deviation known beforehand, or None.
        covered: Whether the interval holds the truth, or None without a truth.
        assumed: Whether the nominal value has no published source.
        note: What the reader should know, such as why it is not identifiable.
        bootstrap: Lower and upper end of the bootstrap's interval, or None.
        realization_relative_std: Relative deviation from the influence of each realization, or None.
    """

    name: str
    kind: str
    unit: str
    nominal: float
    estimate: float
    lower: float
    upper: float
    relative_std: float
    truth: float | None = None
    identifiable: bool = True
    covered: bool | None = None
    assumed: bool = False
    note: str = ""
    bootstrap: tuple[float, float] | None = None
    realization_relative_std: float | None = None
    identified: bool = True
    predicted_relative_std: float | None = None
    known_relative_std: float | None = None


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
class ResonanceRow:
    """One resonance or antiresonance of one channel, measured against the model.

    Attributes:
        configuration: Index of the configuration in the estimation campaign.
        channel: Name of the channel.
        kind: Peak or dip of the magnitude.
        measured_hz: Measured frequency [Hz], or None when the data show none.
        model_hz: The model's frequency, read from its curve as the measured one [Hz], or None when it has none.
        interval_hz: Lower and upper end of the measured frequency's interval [Hz], or None.
        mode_hz: The model's own pole or zero there [Hz], or None.
        mode_interval_hz: Lower and upper end of its interval [Hz], or None.
        damping: Its damping ratio, or None.
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


@dataclass(frozen=True)
class CostRow:
    """The cost in one configuration.

    Attributes:
        campaign: Name of the campaign.
        configuration: Index of the configuration in it.
        cost: Weighted cost.
        expected_cost: Its expectation when the model is exact, or None when no covariance is known.
        excess: Cost above the expectation, or None.
    """

    campaign: str
    configuration: int
    cost: float
    expected_cost: float | None = None
    excess: float | None = None


@dataclass(frozen=True)
class StartRow:
    """One start of the optimizer.

    Attributes:
        index: Index of the start; 0 are the robot file's values.
        cost: Cost where it ended.
        iterations: Iterations it took.
        status: How it ended.
        minimum_index: Index of the minimum that it ended in; 0 is the best.
        evaluations: Points at which the cost was computed; None where they were not counted.
    """

    index: int
    cost: float
    iterations: int
    status: str
    minimum_index: int
    evaluations: int | None = None


@dataclass(frozen=True)
class FitContent:
    """One fit with the data that it explains.

    Attributes:
        name: Name of the fit.
        campaign: Name of the estimation campaign.
        frf: Measured frequency responses.
        model_response (n_conf, n_freq, n_out, n_in): The model's, in the unit of `frf.response`.
        level: Level of the intervals and the band.
        parameters: The parameters, in the order to show.
        resonances: Resonances and antiresonances.
        estimation_costs: Cost per configuration of the fit's own data.
        validation_costs: Cost per configuration of data that the fit never saw.
        starts: The optimizer's starts.
        status: How the fit ended.
        advice: What to do about it; empty when there is nothing to do.
        misfit: Cost over what noise and the assumed model error give; above 1 the intervals are widened by its root.
        undetermined: Combinations of parameters that the data do not determine, a sentence each.
        element_errors: The residuals against their covariance, or None where there is none.
        identifiable_relative_std: Predicted deviation up to which a parameter counts as identifiable.
        interval_rule: What set the width of the intervals, in words.
        grade: How far to trust it; None where that is unknown.
        validation_campaign: Name of the validation campaign.
        validation_frf: Its frequency responses, or None.
        validation_model: The model's responses there, or None.
    """

    name: str
    campaign: str
    frf: Frf
    model_response: ComplexArray
    level: float = 0.95
    parameters: tuple[ParameterRow, ...] = ()
    resonances: tuple[ResonanceRow, ...] = ()
    estimation_costs: tuple[CostRow, ...] = ()
    validation_costs: tuple[CostRow, ...] = ()
    starts: tuple[StartRow, ...] = ()
    status: str = ""
    advice: str = ""
    misfit: float = 0.0
    undetermined: tuple[str, ...] = ()
    element_errors: ElementErrors | None = None
    identifiable_relative_std: float | None = None
    interval_rule: str = ""
    grade: GradeRow | None = None
    validation_campaign: str = ""
    validation_frf: Frf | None = None
    validation_model: ComplexArray | None = None

    def __post_init__(self) -> None:
        _check_model("model_response", self.frf, self.model_response)
        if self.validation_frf is not None and self.validation_model is not None:
            _check_model("validation_model", self.validation_frf, self.validation_model)


def _check_model(name: str, frf: Frf, model: ComplexArray) -> None:
    axes = ("n_conf", "n_freq", "n_out", "n_in")
    check_shape(name, model, " ".join(axes), **dict(zip(axes, frf.response.shape, strict=True)))


@dataclass(frozen=True)
class ConfigurationRow:
    """One measured configuration.

    Attributes:
        campaign: Name of the campaign.
        index: Index in the campaign.
        angles_rad: Arm-side joint angles [rad].
    """

    campaign: str
    index: int
    angles_rad: tuple[float, ...]


@dataclass(frozen=True)
class PeakRow:
    """A predicted peak against its limit.

    Attributes:
        channel: Motor or joint.
        quantity: What peaks, as in `speed`.
        unit: SI unit of both.
        predicted: Predicted peak.
        limit: Limit.
        rms: Predicted RMS, or None.
    """

    channel: str
    quantity: str
    unit: str
    predicted: float
    limit: float
    rms: float | None = None


@dataclass(frozen=True)
class ExcitationRow:
    """What one campaign excites with.

    Attributes:
        campaign: Name of the campaign.
        lines: Number of excited lines.
        low_hz: Lowest excited frequency [Hz].
        high_hz: Highest excited frequency [Hz].
        duration_s: Measuring time over all configurations [s].
        rms: RMS of the injected signal, one for all channels or one each.
        rms_unit: Its unit.
        peaks: Predicted peaks against limits.
        detection_lines: Number of odd lines left out on purpose.
        period_s: Length of a period [s], or None.
        crest_factor: The highest of all experiments, or None.
        worst_snr_db: Lowest predicted signal-to-noise ratio of all lines and motors [dB], or None.
    """

    campaign: str
    lines: int
    low_hz: float
    high_hz: float
    duration_s: float
    rms: tuple[float, ...]
    rms_unit: str
    peaks: tuple[PeakRow, ...] = ()
    detection_lines: int = 0
    period_s: float | None = None
    crest_factor: float | None = None
    worst_snr_db: float | None = None


@dataclass(frozen=True)
class TorqueRow:
    """Torque that compensation removed, over a campaign.

    Attributes:
        campaign: Name of the campaign.
        channel: Motor.
        removed_rms: RMS of the removed torque.
        unit: Its unit.
    """

    campaign: str
    channel: str
    removed_rms: float
    unit: str = "N m"


@dataclass(frozen=True)
class StageRow:
    """One stage that was run.

    Attributes:
        stage: Name of the stage.
        artifact: Path of the artifact in the run folder.
        settings_hash: Short hash of the settings it read.
        content_hash: Short hash of what it wrote.
        seconds: Time it took [s], or None when it was not run anew.
        figures: Key figures in a phrase.
    """

    stage: str
    artifact: str
    settings_hash: str
    content_hash: str
    seconds: float | None = None
    figures: str = ""


@dataclass(frozen=True)
class ReportContent:
    """All of a report.

    Attributes:
        title: Title of the page, usually the experiment's name.
        verdict: The answer in one line.
        robot: Name of the robot.
        robot_notes: Notes of the robot file.
        fits: The fits, the most important first.
        joint_names: Names of the joints, for the table of configurations.
        configurations: The measured configurations.
        excitations: The excitation per campaign.
        removed_torques: Removed friction torque per campaign and motor.
        stages: What was run.
        warnings: What the reader must know before using a number.
        sections: Sections of a study.
    """

    title: str
    verdict: Verdict
    robot: str
    robot_notes: tuple[str, ...] = ()
    fits: tuple[FitContent, ...] = ()
    joint_names: tuple[str, ...] = ()
    configurations: tuple[ConfigurationRow, ...] = ()
    excitations: tuple[ExcitationRow, ...] = ()
    removed_torques: tuple[TorqueRow, ...] = ()
    stages: tuple[StageRow, ...] = ()
    warnings: tuple[str, ...] = ()
    sections: tuple[Section, ...] = ()
