"""What is kept of one identified channel."""

from __future__ import annotations

from dataclasses import dataclass

from robid.arrays import ComplexArray, FloatArray
from robid.artifacts.artifact import Artifact
from robid.artifacts.mapping import Column, from_datasets, to_datasets
from robid.studies.oliveira2019.plants.judging import RootValue
from robid.studies.tasks import Content

CONFIDENCE = 0.97
"""Level of the paper's bounds."""


@dataclass(frozen=True)
class Tried:
    """One structure that was tried.

    Attributes:
        poles: Number of poles.
        zeros: Number of zeros.
        delay_samples: Delay.
        bic: Bayesian information criterion.
        whiteness_p: Chance of white residuals to look as correlated.
        chosen: Whether it was taken.
    """

    poles: int
    zeros: int
    delay_samples: int
    bic: float
    whiteness_p: float
    chosen: bool


@dataclass(frozen=True)
class Quality:
    """Table 2's measures on the validation.

    Attributes:
        r2: Coefficient of determination.
        nrmse: Normalised root mean square error, 1 where all is explained.
        fpe: Akaike's final prediction error, in the paper's units squared [mm^2 or degrees^2].
    """

    r2: float
    nrmse: float
    fpe: float


@dataclass(frozen=True)
class Identified:
    """One channel, identified from one seed's noise.

    Attributes:
        numerator (n_zero + 1,): Estimate, highest power of s first.
        denominator (n_pole + 1,): As the numerator.
        covariance (n_param, n_param): Of the numerator's coefficients and the denominator's after the first.
        delay_samples: Estimated delay.
        reason: Why this structure.
        status: How the fit ended.
        roots: Poles and zeros.
        undetermined: What the data do not determine, and what else is to be known, a sentence each.
        tried: The structures that were tried.
        quality: On the validation.
        frequency_hz (n_freq,): Frequencies of the responses [Hz].
        response (n_freq,): Of the estimate from samples to samples: with hold, average and delay.
        continuous (n_freq,): Of its transfer function, with the delay.
        relative_std (n_freq,): Predicted relative deviation of the magnitude.
        phase_std (n_freq,): Predicted deviation of the phase [rad].
        etfe_hz (n_etfe,): Frequencies of the empirical response [Hz].
        etfe (n_etfe,): Empirical response.
        etfe_radius (n_etfe,): Its confidence radius.
        command (n_sample,): The validation's chirp [m or rad].
        measured (n_sample,): Mean of the repeats.
        simulated (n_sample,): What the estimate says.
        bound (n_sample,): Half width of its interval of `CONFIDENCE`.
        step_s (n_step,): Times since a unit step of the command: every sample [s].
        step (n_step,): What the estimate answers, without the moving average.
        step_std (n_step,): Its predicted deviation.
    """

    numerator: FloatArray
    denominator: FloatArray
    covariance: FloatArray
    delay_samples: int
    reason: str
    status: str
    roots: tuple[RootValue, ...]
    undetermined: tuple[str, ...]
    tried: tuple[Tried, ...]
    quality: Quality
    frequency_hz: FloatArray
    response: ComplexArray
    continuous: ComplexArray
    relative_std: FloatArray
    phase_std: FloatArray
    etfe_hz: FloatArray
    etfe: ComplexArray
    etfe_radius: FloatArray
    command: FloatArray
    measured: FloatArray
    simulated: FloatArray
    bound: FloatArray
    step_s: FloatArray
    step: FloatArray
    step_std: FloatArray


_FREQUENCY, _ETFE, _SAMPLE, _STEP = ("frequency",), ("etfe",), ("sample",), ("step",)
_TABLE = {
    "numerator": Column("rad/s, powers", ("power",), "Highest power first"),
    "denominator": Column("rad/s, powers", ("power",), "Highest power first"),
    "covariance": Column("SI", ("parameter", "parameter")),
    "roots": Column("as named", ("root",)),
    "undetermined": Column("1", ("sentence",)),
    "tried": Column("as named", ("structure",)),
    "frequency_hz": Column("Hz", _FREQUENCY),
    "response": Column("1", _FREQUENCY, "Of the estimate, from samples to samples"),
    "continuous": Column("1", _FREQUENCY, "Of its transfer function, with the delay"),
    "relative_std": Column("1", _FREQUENCY, "Of the magnitude"),
    "phase_std": Column("rad", _FREQUENCY),
    "etfe_hz": Column("Hz", _ETFE),
    "etfe": Column("1", _ETFE, "Empirical response"),
    "etfe_radius": Column("1", _ETFE),
    "command": Column("m or rad", _SAMPLE, compact=True),
    "measured": Column("m or rad", _SAMPLE, compact=True),
    "simulated": Column("m or rad", _SAMPLE, compact=True),
    "bound": Column("m or rad", _SAMPLE, compact=True),
    "step_s": Column("s", _STEP),
    "step": Column("1", _STEP),
    "step_std": Column("1", _STEP),
}


def to_content(found: Identified) -> Content:
    """Returns what a task keeps of a channel."""
    return Content(*to_datasets(found, _TABLE))


def from_content(artifact: Artifact) -> Identified:
    """Returns the channel that a task kept."""
    return from_datasets(Identified, artifact)
