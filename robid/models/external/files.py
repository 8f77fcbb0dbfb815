"""How transfer functions and their validations lie in their files."""

from __future__ import annotations

from robid.artifacts.artifact import Artifact
from robid.artifacts.mapping import Column, from_datasets, to_datasets
from robid.artifacts.model import estimate_from_artifact, model_to_artifact
from robid.artifacts.validation import outcome_from_artifact, validation_to_artifact
from robid.models.external.fit.solution import ExternalSolution
from robid.models.external.judge.validating import ExternalValidation
from robid.results.grade import Grade

_NAME = "external"
_IN, _OUT, _BLOCK, _CHANNEL = ("input",), ("output",), ("block",), ("channel",)
_PAIR, _LINE, _BAND = ("output", "input"), ("frequency", "output", "input"), ("band", "output", "input")
_ROW, _MODEL, _TIME = ("row",), ("model_frequency", "channel"), ("time", "channel")
_SAMPLE, _COMPONENT, _OWN_CHANNEL = ("sample",), ("component",), ("own_channel",)
_OWN = "as of the output"
_GAIN = "output over input"
_SOLUTION = {
    "external/ports/inputs": Column("1", _IN, "Names of the commands"),
    "external/ports/input_units": Column("1", _IN),
    "external/ports/outputs": Column("1", _OUT, "Names of the outputs"),
    "external/ports/output_units": Column("1", _OUT),
    "external/ports/input_resolution": Column("as in input_units", _IN, "Resolution that gains are normalised by"),
    "external/ports/output_resolution": Column("as in output_units", _OUT, "The same"),
    "external/ports/floor": Column("as in input_units", _IN, "Amplitude from which on a command counts as excited"),
    "external/transfers/blocks": Column("1", _BLOCK, "Names of the blocks, which have common poles"),
    "external/transfers/poles": Column("1", _BLOCK, "Number of poles"),
    "external/transfers/zeros": Column("1", _BLOCK, "Number of zeros"),
    "external/transfers/delay_samples": Column("1", _BLOCK, "Transport delay in samples"),
    "external/transfers/delay_estimated": Column("1", _BLOCK, "Whether it was searched"),
    "external/transfers/denominator": Column("powers of rad/s", ("block", "power"), "Highest power first"),
    "external/transfers/covariance_root": Column(
        "powers of rad/s", ("block", "coefficient", "root"), "Root of the coefficients' covariance"
    ),
    "external/transfers/names": Column("1", _CHANNEL, "Names of the channels"),
    "external/transfers/block_of": Column("1", _CHANNEL, "Index of its block"),
    "external/transfers/inputs": Column("1", _CHANNEL, "Index of its command"),
    "external/transfers/outputs": Column("1", _CHANNEL, "Index of its output"),
    "external/transfers/numerator": Column("powers of rad/s", ("channel", "power"), "Highest power first"),
    "external/quality/status": Column("1", _BLOCK, "How each fit ended"),
    "external/quality/reason": Column("1", _BLOCK, "Why its structure was chosen"),
    "external/quality/fpe": Column("1", _BLOCK, "Akaike's final prediction error, relative"),
    "external/quality/whiteness_p": Column("1", _BLOCK, "Chance of white residuals to look as correlated"),
    "external/quality/n_sample": Column("1", _BLOCK, "Samples of each output"),
    "external/quality/n_parameter": Column("1", _BLOCK, "Parameters"),
    "external/quality/lowest_hz": Column("Hz", _BLOCK, "Lowest excited frequency"),
    "external/quality/highest_hz": Column("Hz", _BLOCK, "Highest one"),
    "external/quality/output_names": Column("1", ("block_output",), "Outputs of all blocks"),
    "external/quality/first_output": Column("1", _BLOCK, "First of them of each block"),
    "external/quality/nrmse": Column("1", ("block_output",), "NRMSE where it is worst"),
    "external/agreements": Column("1, or as of the output", ("agreement",), "Agreement, place by place"),
    "external/tried": Column("1", ("trial",), "Structures that were tried"),
    "external/etfe/frequency_hz": Column("Hz", ("frequency",)),
    "external/etfe/response": Column(_GAIN, _LINE, "Empirical response"),
    "external/etfe/radius": Column(_GAIN, _LINE, "Its confidence radius"),
    "external/coupling/bands": Column("1", ("band",), "Shots"),
    "external/coupling/highest_hz": Column("Hz", ("band",), "Highest excited frequency"),
    "external/coupling/coherence": Column("1", _BAND, "Root of the largest coherence"),
    "external/coupling/limit": Column("1", ("band",), "What chance alone reaches"),
    "external/coupling/ratio": Column("1", _BAND, "Magnitude ratio in resolutions"),
    "external/coupling/own": Column("1", _PAIR, "Whether it is one channel and no coupling"),
    "external/coupling/coupled": Column("1", _BAND, "Whether both are above their thresholds"),
    "external/coupling/frequency_hz": Column("Hz", ("frequency",)),
    "external/coupling/gain": Column("1", _LINE, "Magnitude of the empirical response in resolutions"),
    "external/coupling/gain_radius": Column("1", _LINE, "Its confidence radius"),
    "external/coupling/crossing_hz": Column("Hz", _PAIR, "Where the gain exceeds its threshold"),
    "external/coupling/decoupled_up_to_hz": Column("Hz", _IN, "Up to where a channel is decoupled"),
    "external/responses/frequency_hz": Column("Hz", ("model_frequency",)),
    "external/responses/response": Column(_GAIN, _MODEL, "Responses of the models with delay"),
    "external/responses/sampled": Column(_GAIN, _MODEL, "From samples to samples, hold and average included"),
    "external/responses/relative_std": Column("1", _MODEL, "Deviation of the magnitude, relative"),
    "external/responses/phase_std": Column("rad", _MODEL, "Deviation of the phase"),
    "external/steps/time_s": Column("s", _TIME),
    "external/steps/value": Column(_GAIN, _TIME, "Responses to unit steps"),
    "external/steps/std": Column(_GAIN, _TIME, "Their deviations"),
    "external/steps/undershoot": Column("1", _CHANNEL, "Over the final value"),
    "external/steps/overshoot": Column("1", _CHANNEL, "Over the final value"),
    "external/steps/rise_s": Column("s", _CHANNEL, "From 10 to 90 %"),
    "external/loci/gain": Column("1", ("gain",), "Loop gain, over that of static loop gain 1"),
    "external/loci/roots": Column("rad/s", ("gain", "channel", "pole"), "Closed-loop poles"),
    "external/loci/zeros": Column("rad/s", ("channel", "zero")),
    "external/loci/poles": Column("rad/s", ("channel", "pole")),
    "external/loci/zero_std": Column("rad/s", ("channel", "zero"), "Deviations of real and imaginary parts"),
    "external/loci/pole_std": Column("rad/s", ("channel", "pole"), "Deviations of real and imaginary parts"),
    "external/traces/output": Column("1", _ROW, "Index into quality/output_names"),
    "external/traces/shot": Column("1", _ROW, "Index into shots"),
    "external/traces/shots": Column("1", ("shot",), "Names of the shots"),
    "external/traces/time_s": Column("s", _ROW),
    "external/traces/measured": Column(_OWN, _ROW, "Measured output less its offset", compact=True),
    "external/traces/simulated": Column(_OWN, _ROW, "The model's", compact=True),
    "external/excitation/names": Column("1", _OWN_CHANNEL, "Channels, one a command"),
    "external/excitation/shots": Column("1", ("shot",), "Names of the shots"),
    "external/excitation/time_channel": Column("1", _SAMPLE, "Index into names"),
    "external/excitation/time_shot": Column("1", _SAMPLE, "Index into shots"),
    "external/excitation/time_s": Column("s", _SAMPLE),
    "external/excitation/command": Column("as of the command", _SAMPLE, "What was commanded", compact=True),
    "external/excitation/answer": Column(_OWN, _SAMPLE, "What came of it", compact=True),
    "external/excitation/line_channel": Column("1", _COMPONENT, "Index into names"),
    "external/excitation/line_shot": Column("1", _COMPONENT, "Index into shots"),
    "external/excitation/frequency_hz": Column("Hz", _COMPONENT),
    "external/excitation/command_amplitude": Column("as of the command", _COMPONENT, "Largest around it"),
    "external/excitation/answer_amplitude": Column(_OWN, _COMPONENT, "Largest around it"),
    "external/excitation/command_resolution": Column("as of the command", _OWN_CHANNEL),
    "external/excitation/answer_resolution": Column(_OWN, _OWN_CHANNEL),
    "external/findings": Column("1", ("finding",), "What is doubtful about the data"),
    "external/homes": Column("rad; m", ("home", "joint"), "Configurations of the fit's records"),
    "external/remarks": Column("1", ("remark",), "What else is to be known of the models"),
}
_VALIDATION = {
    "external/agreements": Column("1, or as of the output", ("agreement",), "Agreement, place by place"),
    "external/bounds": Column("1, or as of the output", ("agreement",), "The same against the bounds"),
    "external/traces/names": Column("1", _OUT, "The outputs"),
    "external/traces/output": Column("1", _ROW, "Index into names"),
    "external/traces/shots": Column("1", ("shot",), "Names of the shots"),
    "external/traces/shot": Column("1", _ROW, "Index into shots"),
    "external/traces/time_s": Column("s", _ROW),
    "external/traces/measured": Column(_OWN, _ROW, "Measured output less its offset", compact=True),
    "external/traces/predicted": Column(_OWN, _ROW, "The model's", compact=True),
    "external/traces/std": Column(_OWN, _ROW, "Deviation of their difference, as expected", compact=True),
    "external/untested": Column("1", _BLOCK, "Channels that do not move in the validation"),
}


def model_of(solution: ExternalSolution, grade: Grade) -> Artifact:
    """Turns a fit's solution and what it is worth by itself into an artifact."""
    own = to_datasets(solution, _SOLUTION, "external/", without=("estimate",))
    return model_to_artifact(_NAME, solution.estimate, grade, own)


def solution_from_artifact(artifact: Artifact) -> ExternalSolution:
    """What a fit found, from its model."""
    return from_datasets(ExternalSolution, artifact, "external/", {"estimate": estimate_from_artifact(artifact)})


def validation_of(validation: ExternalValidation) -> Artifact:
    """Turns a validation into an artifact."""
    own = to_datasets(validation, _VALIDATION, "external/", without=("outcome",))
    return validation_to_artifact(_NAME, validation.outcome, own)


def validation_from_artifact(artifact: Artifact) -> ExternalValidation:
    """The inverse of `validation_of`."""
    return from_datasets(ExternalValidation, artifact, "external/", {"outcome": outcome_from_artifact(artifact)})
