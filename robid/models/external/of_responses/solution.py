"""What an external fit of responses returns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray, Quantity
from robid.results.estimate import Estimate
from robid.results.outcome import Outcome

_LINES = "frequency channel"


@dataclass(frozen=True)
class ResponsePorts:
    """Inputs and outputs of a response."""

    inputs: Annotated[tuple[str, ...], Quantity("1", "input", "Names of the inputs")]
    input_units: Annotated[tuple[str, ...], Quantity("1", "input")]
    outputs: Annotated[tuple[str, ...], Quantity("1", "output", "Names of the outputs")]
    output_units: Annotated[tuple[str, ...], Quantity("1", "output")]
    sampling_period_s: float  # 0 of a response in continuous time [s]
    hold: str  # `zoh` where the response contains a hold, which the transfer functions do not; `none`


@dataclass(frozen=True)
class RationalTransfers:
    """Transfer functions; those of a block have common poles and one delay."""

    time: str  # `continuous`: polynomials in s [rad/s]; `discrete`: in z
    blocks: Annotated[tuple[str, ...], Quantity("1", "block", "Names of the blocks")]
    poles: Annotated[IntArray, Quantity("1", "block", "Number of poles, integrators included")]
    integrators: Annotated[IntArray, Quantity("1", "block", "Exact poles at zero, or at z = 1")]
    delay_s: Annotated[FloatArray, Quantity("s", "block", "Delay beside the polynomials")]
    delay_std_s: Annotated[FloatArray, Quantity("s", "block", "Its deviation; 0 where it was not estimated")]
    denominator: Annotated[FloatArray, Quantity("powers", "block power", "Highest power first, zeros in front")]
    names: Annotated[tuple[str, ...], Quantity("1", "channel", "Names of the channels")]
    block_of: Annotated[IntArray, Quantity("1", "channel", "Index of its block")]
    inputs: Annotated[IntArray, Quantity("1", "channel", "Index of its input")]
    outputs: Annotated[IntArray, Quantity("1", "channel", "Index of its output")]
    zeros: Annotated[IntArray, Quantity("1", "channel", "Number of zeros")]
    numerator: Annotated[FloatArray, Quantity("powers", "channel power", "Highest power first, zeros in front")]

    def response(self, channel: int, frequency_hz: FloatArray, sampling_period_s: float) -> ComplexArray:
        """A channel's response (n_freq,) with its delay and without hold."""
        block = int(self.block_of[channel])
        s = 2j * np.pi * frequency_hz
        x = np.exp(s * sampling_period_s) if self.time == "discrete" else s
        below, above = (np.trim_zeros(each, "f") for each in (self.denominator[block], self.numerator[channel]))
        return np.asarray(np.polyval(above, x) / np.polyval(below, x) * np.exp(-s * self.delay_s[block]))


@dataclass(frozen=True)
class RationalQuality:
    """How well each block explains its response."""

    cost: Annotated[FloatArray, Quantity("1", "block", "Sum of squares over deviations, real and imaginary parts")]
    degrees_of_freedom: Annotated[IntArray, Quantity("1", "block", "What the cost is expected to be")]
    misfit_chance: Annotated[FloatArray, Quantity("1", "block", "Of such a cost, were model and deviations right")]
    widened: Annotated[FloatArray, Quantity("1", "block", "Factor on all deviations, for the misfit")]
    # Root mean square of the relative error over the lines that noise leaves, and what noise explains of it
    relative_error: Annotated[FloatArray, Quantity("1", "channel", "Root mean square relative error")]
    relative_noise: Annotated[FloatArray, Quantity("1", "channel", "What the response's deviation explains of it")]


@dataclass(frozen=True)
class TriedRational:
    """A structure that was tried."""

    block: str
    poles: int  # Integrators included
    zeros: str  # Of each channel
    integrators: int
    delay_s: float
    cost: float
    score: float  # Cost and price of the parameters
    chosen: bool


@dataclass(frozen=True)
class Shown:
    """Measured and fitted responses."""

    frequency_hz: Annotated[FloatArray, Quantity("Hz", "frequency")]
    measured: Annotated[ComplexArray, Quantity("output over input", _LINES, "Measured response; NaN where unknown")]
    measured_std: Annotated[FloatArray, Quantity("output over input", _LINES, "Root of E|error|^2")]
    model: Annotated[
        ComplexArray, Quantity("output over input", _LINES, "Model with delay, and hold where data have it")
    ]
    model_std: Annotated[
        FloatArray, Quantity("output over input", _LINES, "Its deviation, choice of structure included")
    ]

    @property
    def known(self) -> BoolArray:
        """Where the measured response says something (n_freq, n_channel)."""
        return np.asarray(np.isfinite(self.measured) & np.isfinite(self.measured_std))


@dataclass(frozen=True)
class RationalSolution:
    """Transfer functions fitted to a response, and how far they are to be trusted."""

    estimate: Estimate  # Poles, zeros, gains and delays
    ports: ResponsePorts
    transfers: RationalTransfers
    quality: RationalQuality
    tried: Annotated[tuple[TriedRational, ...], Quantity("1", "trial", "Structures that were tried")]
    shown: Shown
    remarks: Annotated[tuple[str, ...], Quantity("1", "remark", "What else is to be known of the models")]


@dataclass(frozen=True)
class RationalValidation:
    """How well transfer functions predict other responses."""

    outcome: Outcome  # Whether they hold, their grade
    shown: Shown  # New responses beside the model
    relative_error: Annotated[FloatArray, Quantity("1", "channel", "Root mean square relative error")]
    expected: Annotated[FloatArray, Quantity("1", "channel", "What noise, parameters and 1 % of model error explain")]
