"""The frequency response artifact.

Schema history:
    1.0: first version.
    1.1: `coefficient_offset`, `uncompensated_response`, the torque laws; coherence, levels at the silent lines.
    1.2: `torque_amplitude`, `realization_error`.
    1.3: `mean_torque`, `mean_position`, `motion_rms`, `compensation`, `line_correlation`,
        `freedom_share`.
    2.0: each input and output has its quantity, unit and side: `input_channels`, `output_channels`; a response need not
        be one from torque to acceleration. `input_hold`, `input_amplitude`, `mean_input` and `mean_output` were
        `torque_hold`, `torque_amplitude`, `mean_torque` and `mean_position`. `joint_units`, where joints
        are prismatic.
    2.1: `dropped`.
    2.2: `saturated_inputs`, `saturated_outputs`.
    2.3: each channel has `sampled`: what its samples are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from robid.artifacts.artifact import Artifact, Kind, Provenance
from robid.artifacts.mapping import Column, from_datasets, position_units, to_datasets
from robid.signals.quantities import units_text

if TYPE_CHECKING:
    from robid.frf.frf import Frf

FRF = Kind("frf", "2.3", "robid estimate-frf")


def frf_to_artifact(frf: Frf, provenance: Provenance) -> Artifact:
    """Turns a frequency response into an artifact."""
    inputs, outputs = frf.input_unit, units_text(frf.output_channels)
    measured = units_text(frf.measured_channels or frf.output_channels)
    per_input = inputs if inputs.isalnum() else f"({inputs})"
    unit = "; ".join(f"{each}/{per_input}" for each in outputs.split("; "))
    response = ("frequency", "output", "input")
    covariance = ("configuration", "frequency", "output", "output")
    silent = ("configuration", "silent", "output")
    table = {
        "frequency_hz": Column("Hz", ("frequency",), "Excited frequencies"),
        "lines": Column("1", ("frequency",), "Their DFT lines"),
        "configurations": Column(position_units(frf.joint_units), ("configuration", "joint"), "Arm-side joints"),
        "joint_units": Column("1", ("joint",), "Units of the joints' positions"),
        "response": Column(unit, ("configuration", *response), "From inputs to outputs, by their channels"),
        "input_factor": Column(
            f"1/{per_input}^2", ("configuration", "frequency", "input", "input"), "Input factor of the covariance"
        ),
        "element_scale": Column("1", ("configuration", "output", "input"), "Element variance over that of the product"),
        "realization_error": Column(
            unit, ("configuration", "realization", *response), "What each realization adds to it"
        ),
        "total_covariance": Column(f"({outputs})^2", covariance, "Output factor, from realizations"),
        "noise_covariance": Column(f"({outputs})^2", covariance, "Output factor, from periods"),
        "sensitivity": Column(
            unit,
            ("configuration", "coefficient", *response),
            "Derivative with respect to relative errors of compensated torque coefficients",
        ),
        "coefficient_names": Column("1", ("coefficient",)),
        "coefficient_relative_std": Column("1", ("coefficient",), "Standard deviation of the relative error"),
        "removed_torque_rms": Column(inputs, ("configuration", "input"), "What compensation removed"),
        "coefficient_offset": Column("1", ("coefficient",), "Distance of the subtracted coefficient from the file's"),
        "uncompensated_response": Column(unit, ("configuration", *response), "The response without compensation"),
        "law_names": Column("1", ("value",), "Values of the subtracted torque laws"),
        "law_values": Column(
            "N m; rad; rad/s; samples; 1", ("value",), "By their names: N m, rad, rad/s, samples or 1"
        ),
        "law_std": Column("N m; rad; rad/s; samples; 1", ("value",), "Their standard deviations"),
        "input_channels": Column("1", ("input",), "What each input is"),
        "output_channels": Column("1", ("output",), "What each output is"),
        "measured_channels": Column("1", ("output",), "What each output was measured as"),
        "notes": Column("1", ("note",)),
        "coherence": Column("1", ("configuration", "frequency", "output"), "Share of power that the response explains"),
        "silent_lines": Column("1", ("silent",), "Lines of the band that were not excited"),
        "silent_level": Column(outputs, silent, "RMS amplitude of the output residual there"),
        "silent_noise": Column(outputs, silent, "The part of it that is noise"),
        "silent_interpolation": Column(outputs, silent, "What interpolating the response may add"),
        "input_amplitude": Column(
            inputs, ("configuration", "frequency", "input", "block"), "Half amplitudes in every experiment"
        ),
        "mean_input": Column(inputs, ("configuration", "input"), "Mean inputs as recorded"),
        "mean_output": Column(measured, ("configuration", "output"), "Mean outputs as measured"),
        "motion_rms": Column(measured, ("configuration", "output"), "RMS of the outputs about their means"),
        "freedom_share": Column("1", ("configuration",), "Of the degrees of freedom, left by experiments that repeat"),
        "dropped": Column("1", ("configuration", "frequency", "input"), "Lines that tell too little of an input"),
        "saturated_inputs": Column("1", ("configuration", "input"), "Share of time at a limit"),
        "saturated_outputs": Column("1", ("configuration", "output"), "Share of time at a limit"),
        "line_correlation": Column("1", ("configuration", "frequency", "next"), "Of errors at overlapping windows"),
    }
    return Artifact(FRF, *to_datasets(frf, table), provenance)


def frf_from_artifact(artifact: Artifact) -> Frf:
    """The inverse of `frf_to_artifact`."""
    from robid.frf.frf import Frf

    return from_datasets(Frf, artifact)
