"""What an external fit returns."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.models.external.fit.agreement import Agreement
from robid.models.external.fit.checks import Finding
from robid.models.external.fit.coupling import CouplingMap
from robid.models.external.fit.etfe import Etfe, Excitation
from robid.models.external.fit.transfer import TransferMatrix
from robid.results.estimate import Estimate


@dataclass(frozen=True)
class Ports:
    """Commands and outputs of a fit's records.

    Attributes:
        inputs: Name of each command.
        input_units: Their units.
        outputs: Name of each output.
        output_units: Their units.
        input_resolution (n_in,): Resolution of each command, in its unit.
        output_resolution (n_out,): The same of each output.
        floor (n_in,): Amplitude of a component from which on a command counts as excited.
        sampling_period_s: Sampling period [s].
        hold: What commands do between samples.
    """

    inputs: tuple[str, ...]
    input_units: tuple[str, ...]
    outputs: tuple[str, ...]
    output_units: tuple[str, ...]
    input_resolution: FloatArray
    output_resolution: FloatArray
    floor: FloatArray
    sampling_period_s: float
    hold: str


@dataclass(frozen=True)
class Transfers:
    """Transfer functions; those of one block have common poles. Polynomials in s, highest power first, zeros in front.

    Attributes:
        blocks: Name of each block; of a single channel that of the channel.
        poles (n_block,): Number of poles.
        zeros (n_block,): Number of zeros.
        delay_samples (n_block,): Transport delay in samples.
        delay_estimated (n_block,): Whether that was searched.
        moving_average: Samples of the commands' moving average.
        denominator (n_block, n_power): Denominators, which begin with 1 (behind zeros).
        covariance_root (n_block, n_coefficient, n_root): A root of the covariance of the numerators' coefficients,
            channel by channel, then of the denominator's without its first; zeros behind.
        names: Name of each channel.
        block_of (n_channel,): Index of its block.
        inputs (n_channel,): Index of its command.
        outputs (n_channel,): Index of its output.
        numerator (n_channel, n_power): Numerators.
    """

    blocks: tuple[str, ...]
    poles: IntArray
    zeros: IntArray
    delay_samples: IntArray
    delay_estimated: BoolArray
    moving_average: int
    denominator: FloatArray
    covariance_root: FloatArray
    names: tuple[str, ...]
    block_of: IntArray
    inputs: IntArray
    outputs: IntArray
    numerator: FloatArray

    def channels_of(self, block: int) -> IntArray:
        """Indices of the channels of a block, output by output."""
        return np.flatnonzero(self.block_of == block)

    def root_of(self, block: int) -> FloatArray:
        """Root (n_coefficient, n_root) of the covariance of a block's own coefficients."""
        count = len(self.channels_of(block)) * (int(self.zeros[block]) + 1) + int(self.poles[block])
        return self.covariance_root[block, :count]


@dataclass(frozen=True)
class FitQuality:
    """How each block was fitted.

    Attributes:
        status: How each fit ended.
        reason: Why each structure was chosen.
        fpe (n_block,): Akaike's final prediction error over the outputs' variance.
        whiteness_p (n_block,): Chance of white residuals to look as correlated, of the worst shot.
        n_sample (n_block,): Samples of each output.
        n_parameter (n_block,): Parameters.
        lowest_hz (n_block,): Lowest frequency at which the shots excite a command [Hz].
        highest_hz (n_block,): Highest one [Hz].
        output_names: The outputs of all blocks: names of single channels, and of the outputs of matrices.
        first_output (n_block,): First of them of each block.
        nrmse (n_output,): Normalised root mean square of each, in the place where it is worst.
    """

    status: tuple[str, ...]
    reason: tuple[str, ...]
    fpe: FloatArray
    whiteness_p: FloatArray
    n_sample: IntArray
    n_parameter: IntArray
    lowest_hz: FloatArray
    highest_hz: FloatArray
    output_names: tuple[str, ...]
    first_output: IntArray
    nrmse: FloatArray


@dataclass(frozen=True)
class Tried:
    """A structure that was tried.

    Attributes:
        block: Name of the block.
        poles: Number of poles.
        zeros: Number of zeros.
        delay_samples: Delay in samples.
        bic: Bayesian information criterion.
        nrmse: Normalised root mean square of the worst output.
        whiteness_p: Chance of white residuals to look as correlated.
        chosen: Whether it was taken.
    """

    block: str
    poles: int
    zeros: int
    delay_samples: int
    bic: float
    nrmse: float
    whiteness_p: float
    chosen: bool


@dataclass(frozen=True)
class Responses:
    """Frequency responses of the models, with their deviations.

    Attributes:
        frequency_hz (n_freq,): Frequencies [Hz].
        response (n_freq, n_channel): Responses with delay, without hold and moving average.
        sampled (n_freq, n_channel): Responses from samples to samples, with all of them, as the empirical one is.
        relative_std (n_freq, n_channel): Standard deviation of the magnitude, relative.
        phase_std (n_freq, n_channel): Of the phase [rad].
    """

    frequency_hz: FloatArray
    response: ComplexArray
    sampled: ComplexArray
    relative_std: FloatArray
    phase_std: FloatArray


@dataclass(frozen=True)
class StepResponses:
    """Responses to a unit step of each command.

    Attributes:
        time_s (n_time, n_channel): Times [s].
        value (n_time, n_channel): Outputs.
        std (n_time, n_channel): Their standard deviations.
        undershoot (n_channel,): How far it goes the wrong way before it reaches a tenth of the final value, over that.
        overshoot (n_channel,): How far it goes beyond the final value, over it; 0 where it never gets there.
        rise_s (n_channel,): Time from 10 to 90 % of the final value [s]; NaN where it never gets there.
    """

    time_s: FloatArray
    value: FloatArray
    std: FloatArray
    undershoot: FloatArray
    overshoot: FloatArray
    rise_s: FloatArray


@dataclass(frozen=True)
class RootLoci:
    """Poles of each channel, without its delay, in a proportional loop around it.

    Attributes:
        gain (n_gain,): Loop gains, over that at which the static loop gain is 1.
        roots (n_gain, n_channel, n_pole): Closed-loop poles [rad/s]; NaN where there are fewer.
        zeros (n_channel, n_zero): Zeros [rad/s]; NaN where there are fewer.
        poles (n_channel, n_pole): Poles [rad/s].
        zero_std (n_channel, n_zero): Standard deviations of the zeros' real parts, and of their imaginary parts as an
            imaginary part [rad/s].
        pole_std (n_channel, n_pole): The same of the poles.
    """

    gain: FloatArray
    roots: ComplexArray
    zeros: ComplexArray
    poles: ComplexArray
    zero_std: ComplexArray
    pole_std: ComplexArray


@dataclass(frozen=True)
class Traces:
    """Measured and simulated outputs, one below the other.

    Attributes:
        output (n_row,): Row of `FitQuality.output_names`.
        shot (n_row,): Index into `shots`.
        shots: Names of the shots.
        time_s (n_row,): Time since the shot began [s].
        measured (n_row,): Measured output less its offset.
        simulated (n_row,): The model's.
    """

    output: IntArray
    shot: IntArray
    shots: tuple[str, ...]
    time_s: FloatArray
    measured: FloatArray
    simulated: FloatArray


@dataclass(frozen=True)
class ExternalSolution:
    """Transfer functions from commands to positions, and how far they are to be trusted.

    Attributes:
        estimate: Poles, zeros and gains.
        ports: Commands and outputs of the records.
        transfers: The transfer functions.
        quality: How they were fitted.
        agreements: How well they describe the fit's own shots.
        tried: Structures that were tried.
        etfe: The empirical response.
        coupling: The decoupling map.
        responses: Frequency responses of the models.
        steps: Step responses.
        loci: Root loci.
        traces: Measured and simulated outputs of the fit's shots.
        findings: What is doubtful about the data.
        remarks: What else is to be known of the models, a sentence each: zeros in the right half plane, poles kept
            stable, how sure the choice of a structure is.
        excitation: Commands and their own outputs in the fit's shots.
        homes (n_home, n_joint): Configurations that these were recorded in; none where they are unknown [rad, or m].
    """

    estimate: Estimate
    ports: Ports
    transfers: Transfers
    quality: FitQuality
    agreements: tuple[Agreement, ...]
    tried: tuple[Tried, ...]
    etfe: Etfe
    coupling: CouplingMap
    responses: Responses
    steps: StepResponses
    loci: RootLoci
    traces: Traces
    findings: tuple[Finding, ...]
    remarks: tuple[str, ...]
    excitation: Excitation
    homes: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))

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
