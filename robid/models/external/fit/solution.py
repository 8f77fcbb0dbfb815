"""What an external fit returns."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray, Quantity
from robid.models.external.fit.checks import ChannelFinding
from robid.models.external.fit.coupling import CouplingMap
from robid.models.external.fit.data import Agreement
from robid.models.external.fit.etfe import Etfe, Excitation
from robid.models.external.fit.transfer import TransferMatrix
from robid.results.estimate import Estimate
from robid.robot.parameters import INTEGRATOR_KIND

_INPUT = "as in input_units"
_OUTPUT = "as of the output"
_SCORE = "1, or as of the output"
_CHANNEL = "model_frequency channel"


@dataclass(frozen=True)
class Ports:
    """Commands and outputs of a fit's records."""

    inputs: Annotated[tuple[str, ...], Quantity("1", "input", "Names of the commands")]
    input_units: Annotated[tuple[str, ...], Quantity("1", "input")]
    outputs: Annotated[tuple[str, ...], Quantity("1", "output", "Names of the outputs")]
    output_units: Annotated[tuple[str, ...], Quantity("1", "output")]
    input_resolution: Annotated[FloatArray, Quantity(_INPUT, "input", "Resolution that gains are normalised by")]
    output_resolution: Annotated[FloatArray, Quantity("as in output_units", "output", "The same")]
    floor: Annotated[FloatArray, Quantity(_INPUT, "input", "Amplitude from which on a command counts as excited")]
    sampling_period_s: float
    hold: str  # what commands do between samples


@dataclass(frozen=True)
class Transfers:
    """Transfer functions; those of a block have common poles. Polynomials in s, highest power first, zeros in front."""

    blocks: Annotated[tuple[str, ...], Quantity("1", "block", "Names of the blocks, which have common poles")]
    poles: Annotated[IntArray, Quantity("1", "block", "Number of poles")]
    zeros: Annotated[IntArray, Quantity("1", "block", "Number of zeros")]
    delay_samples: Annotated[IntArray, Quantity("1", "block", "Transport delay in samples")]
    delay_estimated: Annotated[BoolArray, Quantity("1", "block", "Whether it was searched")]
    moving_average: int  # samples of the commands' moving average
    denominator: Annotated[FloatArray, Quantity("powers of rad/s", "block power", "Highest power first")]
    # A root of the covariance of the numerators' coefficients, channel by channel, then of the denominator's without
    # its first; zeros behind.
    covariance_root: Annotated[
        FloatArray, Quantity("powers of rad/s", "block coefficient root", "Root of the coefficients' covariance")
    ]
    names: Annotated[tuple[str, ...], Quantity("1", "channel", "Names of the channels")]
    block_of: Annotated[IntArray, Quantity("1", "channel", "Index of its block")]
    inputs: Annotated[IntArray, Quantity("1", "channel", "Index of its command")]
    outputs: Annotated[IntArray, Quantity("1", "channel", "Index of its output")]
    numerator: Annotated[FloatArray, Quantity("powers of rad/s", "channel power", "Highest power first")]

    def channels_of(self, block: int) -> IntArray:
        """Indices of the channels of a block, output by output."""
        return np.flatnonzero(self.block_of == block)

    def root_of(self, block: int) -> FloatArray:
        """Root (n_coefficient, n_root) of the covariance of a block's own coefficients."""
        count = len(self.channels_of(block)) * (int(self.zeros[block]) + 1) + int(self.poles[block])
        return self.covariance_root[block, :count]


@dataclass(frozen=True)
class FitQuality:
    """How each block was fitted."""

    status: Annotated[tuple[str, ...], Quantity("1", "block", "How each fit ended")]
    reason: Annotated[tuple[str, ...], Quantity("1", "block", "Why its structure was chosen")]
    fpe: Annotated[FloatArray, Quantity("1", "block", "Akaike's final prediction error, relative")]
    whiteness_p: Annotated[FloatArray, Quantity("1", "block", "Chance of white residuals to look as correlated")]
    n_sample: Annotated[IntArray, Quantity("1", "block", "Samples of each output")]
    n_parameter: Annotated[IntArray, Quantity("1", "block", "Parameters")]
    # NaN where commands excite no line, as slopes do
    lowest_hz: Annotated[FloatArray, Quantity("Hz", "block", "Lowest excited frequency")]
    highest_hz: Annotated[FloatArray, Quantity("Hz", "block", "Highest one; NaN likewise")]
    # The outputs of all blocks: names of single channels, and of the outputs of matrices.
    output_names: Annotated[tuple[str, ...], Quantity("1", "block_output", "Outputs of all blocks")]
    first_output: Annotated[IntArray, Quantity("1", "block", "First of them of each block")]
    nrmse: Annotated[FloatArray, Quantity("1", "block_output", "NRMSE where it is worst")]


@dataclass(frozen=True)
class Tried:
    """A structure that was tried."""

    block: str
    poles: int  # number of poles
    zeros: int  # number of zeros
    delay_samples: int  # delay in samples
    bic: float  # Bayesian information criterion
    nrmse: float  # normalised root mean square of the worst output
    whiteness_p: float  # chance of white residuals to look as correlated
    chosen: bool  # whether it was taken


@dataclass(frozen=True)
class Responses:
    """Frequency responses of the models, with their deviations."""

    frequency_hz: Annotated[FloatArray, Quantity("Hz", "model_frequency")]
    # Responses with delay, without hold and moving average.
    response: Annotated[ComplexArray, Quantity("output over input", _CHANNEL, "Responses of the models with delay")]
    sampled: Annotated[
        ComplexArray, Quantity("output over input", _CHANNEL, "From samples to samples, hold and average included")
    ]
    # NaN of both where a channel answers with nothing
    relative_std: Annotated[FloatArray, Quantity("1", _CHANNEL, "Deviation of the magnitude, relative")]
    phase_std: Annotated[FloatArray, Quantity("rad", _CHANNEL, "Deviation of the phase; NaN likewise")]


@dataclass(frozen=True)
class StepResponses:
    """Responses to a unit step of each command."""

    time_s: Annotated[FloatArray, Quantity("s", "time channel")]
    value: Annotated[FloatArray, Quantity("output over input", "time channel", "Responses to unit steps")]
    std: Annotated[FloatArray, Quantity("output over input", "time channel", "Their deviations")]
    # How far it goes the wrong way before it reaches a tenth of the final value, over that.
    undershoot: Annotated[FloatArray, Quantity("1", "channel", "Over the final value")]
    # How far it goes beyond the final value, over it; 0 where it never gets there.
    overshoot: Annotated[FloatArray, Quantity("1", "channel", "Over the final value")]
    # NaN where a step leads to no final value, or not to it
    rise_s: Annotated[FloatArray, Quantity("s", "channel", "From 10 to 90 %")]


@dataclass(frozen=True)
class RootLoci:
    """Poles of each channel, without its delay, in a proportional loop around it; NaN where there are fewer."""

    gain: Annotated[FloatArray, Quantity("1", "gain", "Loop gain, over that of static loop gain 1")]
    roots: Annotated[ComplexArray, Quantity("rad/s", "gain channel pole", "Closed-loop poles")]
    zeros: Annotated[ComplexArray, Quantity("rad/s", "channel zero")]
    poles: Annotated[ComplexArray, Quantity("rad/s", "channel pole")]
    zero_std: Annotated[ComplexArray, Quantity("rad/s", "channel zero", "Deviations of real and imaginary parts")]
    pole_std: Annotated[ComplexArray, Quantity("rad/s", "channel pole", "Deviations of real and imaginary parts")]


@dataclass(frozen=True)
class Traces:
    """Measured and simulated outputs, one below the other."""

    output: Annotated[IntArray, Quantity("1", "row", "Index into quality/output_names")]
    shot: Annotated[IntArray, Quantity("1", "row", "Index into shots")]
    shots: Annotated[tuple[str, ...], Quantity("1", "shot", "Names of the shots")]
    time_s: Annotated[FloatArray, Quantity("s", "row")]  # time since the shot began
    measured: Annotated[FloatArray, Quantity(_OUTPUT, "row", "Measured output less its offset", compact=True)]
    simulated: Annotated[FloatArray, Quantity(_OUTPUT, "row", "The model's", compact=True)]


@dataclass(frozen=True)
class ExternalSolution:
    """Transfer functions from commands to positions, and how far they are to be trusted."""

    estimate: Estimate  # Poles, zeros and gains
    ports: Ports  # commands and outputs of the records
    transfers: Transfers  # the transfer functions
    quality: FitQuality  # how they were fitted
    agreements: Annotated[tuple[Agreement, ...], Quantity(_SCORE, "agreement", "Agreement, place by place")]
    tried: Annotated[tuple[Tried, ...], Quantity("1", "trial", "Structures that were tried")]
    etfe: Etfe  # the empirical response
    coupling: CouplingMap  # the decoupling map
    responses: Responses  # frequency responses of the models
    steps: StepResponses
    loci: RootLoci
    traces: Traces  # measured and simulated outputs of the fit's shots
    findings: Annotated[tuple[ChannelFinding, ...], Quantity("1", "finding", "What is doubtful about the data")]
    # What else is to be known of the models, a sentence each: zeros in the right half plane, poles kept stable, how
    # sure the choice of a structure is.
    remarks: Annotated[tuple[str, ...], Quantity("1", "remark", "What else is to be known of the models")]
    excitation: Excitation  # commands and their own outputs in the fit's shots
    # Configurations that these were recorded in; none where they are unknown.
    homes: Annotated[FloatArray, Quantity("rad; m", "home joint", "Configurations of the fit's records")] = field(
        default_factory=lambda: np.zeros((0, 0))
    )
    # Deviation of each parameter between recordings, relative; 0 where noise explains what differs, NaN where only one
    # recording tells it.
    between_std: Annotated[FloatArray, Quantity("1", "parameter", "Deviation between recordings, relative")] = field(
        default_factory=lambda: np.zeros(0)
    )
    recordings: Annotated[IntArray, Quantity("1", "block", "Recordings that each block was fitted to")] = field(
        default_factory=lambda: np.zeros(0, int)
    )

    def integrators(self, block: int) -> int:
        """How many of a block's poles are integrators."""
        own = f"{self.transfers.blocks[block]}.pole"
        pairs = zip(self.estimate.names, self.estimate.kinds, strict=True)
        return sum(kind == INTEGRATOR_KIND and name.startswith(own) for name, kind in pairs)

    def transfer(self, block: int) -> TransferMatrix:
        """Returns the transfer functions of one block."""
        own, ports = self.transfers, self.ports
        channels = own.channels_of(block)
        outputs, inputs = (list(dict.fromkeys(which[channels].tolist())) for which in (own.outputs, own.inputs))
        n_zero, n_pole = int(own.zeros[block]), int(own.poles[block])
        hold: Literal["zoh", "foh"] = "zoh" if ports.hold == "zoh" else "foh"
        return TransferMatrix(
            inputs=tuple(ports.inputs[index] for index in inputs),
            outputs=tuple(ports.outputs[index] for index in outputs),
            numerator=own.numerator[channels, -(n_zero + 1) :].reshape(len(outputs), len(inputs), n_zero + 1),
            denominator=own.denominator[block, -(n_pole + 1) :],
            delay_samples=int(own.delay_samples[block]),
            moving_average=own.moving_average,
            sampling_period_s=ports.sampling_period_s,
            hold=hold,
        )
