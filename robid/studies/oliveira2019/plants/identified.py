"""What is kept of one identified channel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from robid.arrays import ComplexArray, FloatArray, Quantity
from robid.artifacts.artifact import Artifact
from robid.artifacts.mapping import from_datasets, to_datasets
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
        delay_samples: Estimated delay.
        reason: Why this structure.
        status: How the fit ended.
        quality: On the validation.
    """

    numerator: Annotated[FloatArray, Quantity("rad/s, powers", "power", "Highest power first")]
    denominator: Annotated[FloatArray, Quantity("rad/s, powers", "power", "Highest power first")]
    covariance: Annotated[
        FloatArray,
        Quantity("SI", "parameter parameter", "Of the numerator's coefficients and the denominator's after the first"),
    ]
    delay_samples: int
    reason: str
    status: str
    roots: Annotated[tuple[RootValue, ...], Quantity("as named", "root", "Poles and zeros")]
    undetermined: Annotated[
        tuple[str, ...],
        Quantity("1", "sentence", "What the data do not determine, and what else is to be known, a sentence each"),
    ]
    tried: Annotated[tuple[Tried, ...], Quantity("as named", "structure", "The structures that were tried")]
    quality: Quality
    frequency_hz: Annotated[FloatArray, Quantity("Hz", "frequency", "Frequencies of the responses")]
    response: Annotated[ComplexArray, Quantity("1", "frequency", "Of the estimate, from samples to samples")]
    continuous: Annotated[ComplexArray, Quantity("1", "frequency", "Of its transfer function, with the delay")]
    relative_std: Annotated[FloatArray, Quantity("1", "frequency", "Of the magnitude")]
    phase_std: Annotated[FloatArray, Quantity("rad", "frequency", "Predicted deviation of the phase")]
    etfe_hz: Annotated[FloatArray, Quantity("Hz", "etfe", "Frequencies of the empirical response")]
    etfe: Annotated[ComplexArray, Quantity("1", "etfe", "Empirical response")]
    etfe_radius: Annotated[FloatArray, Quantity("1", "etfe", "Its confidence radius")]
    command: Annotated[FloatArray, Quantity("m or rad", "sample", "The validation's chirp", compact=True)]
    measured: Annotated[FloatArray, Quantity("m or rad", "sample", "Mean of the repeats", compact=True)]
    simulated: Annotated[FloatArray, Quantity("m or rad", "sample", "What the estimate says", compact=True)]
    bound: Annotated[
        FloatArray, Quantity("m or rad", "sample", "Half width of its interval of `CONFIDENCE`", compact=True)
    ]
    step_s: Annotated[FloatArray, Quantity("s", "step", "Times since a unit step of the command: every sample")]
    step: Annotated[FloatArray, Quantity("1", "step", "What the estimate answers, without the moving average")]
    step_std: Annotated[FloatArray, Quantity("1", "step", "Its predicted deviation")]


def to_content(found: Identified) -> Content:
    """Returns what a task keeps of a channel."""
    return Content(*to_datasets(found))


def from_content(artifact: Artifact) -> Identified:
    """Returns the channel that a task kept."""
    return from_datasets(Identified, artifact)
