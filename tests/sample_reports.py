"""A synthetic six-axis report and a one-input two-output bench report."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from robid.frf.frf import Frf
from robid.models.elastic.judge.modes import ArmModes
from robid.models.elastic.page.fitted import FittedViews, Peak
from robid.models.elastic.page.gather import FitContent, ResonanceRow
from robid.models.elastic.page.report import fit_report
from robid.report.costs import CostRow, StartRow
from robid.report.experiment import (
    ConfigurationRow,
    ExcitationRow,
    PeakRow,
    StageRow,
    TorqueRow,
    experiment_section,
    run_section,
)
from robid.report.page import ReportContent, Verdict, fit_sections
from robid.report.parameters import Estimates, ParameterRow
from robid.results.line_residuals import compare_lines
from robid.signals.quantities import motor_channels

AXES = tuple(f"axis_{number}" for number in range(1, 7))


@dataclass(frozen=True)
class Sample:
    """A fit and what the page says around it."""

    fit: FitContent
    title: str
    verdict: Verdict
    robot: str
    robot_notes: tuple[str, ...] = ()
    excitations: tuple[ExcitationRow, ...] = ()
    removed_torques: tuple[TorqueRow, ...] = ()
    configurations: tuple[ConfigurationRow, ...] = ()
    stages: tuple[StageRow, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def content(self) -> ReportContent:
        """The page."""
        fits = (fit_report(self.fit, told=self.warnings),)
        measured = self.excitations, self.removed_torques, AXES, self.configurations
        return ReportContent(
            title=self.title,
            verdict=self.verdict,
            robot=self.robot,
            headlines=tuple(fit.headline for fit in fits),
            warnings=self.warnings,
            sections=(*fit_sections(fits), *experiment_section(self.robot_notes, *measured), *run_section(self.stages)),
        )


def elastic_arm_response(frequency_hz, angles_rad, stiffness, damping):
    """Motor torque to motor acceleration (n_freq, n, n) of motors, springs and a coupled arm, motor side."""
    n = len(stiffness)
    rng = np.random.default_rng(7)
    lever = np.eye(n) + 0.35 * np.tril(rng.normal(size=(n, n)), -1) * np.cos(angles_rad)[:, None]
    arm = lever @ np.diag(0.012 * 0.62 ** np.arange(n)) @ lever.T
    mass = np.block([[np.diag(0.008 * 0.75 ** np.arange(n)), np.zeros((n, n))], [np.zeros((n, n)), arm]])
    pattern = np.array([[1.0, -1.0], [-1.0, 1.0]])
    response = []
    for omega in 2 * np.pi * frequency_hz:
        spring = np.diag(stiffness + 1j * omega * damping)
        dynamic = np.kron(pattern, spring) - omega**2 * mass
        dynamic[:n, :n] += 1j * omega * 0.01 * np.eye(n)
        response.append(-(omega**2) * np.linalg.inv(dynamic)[:n, :n])
    return np.array(response)


def synthetic_frf(response, frequency_hz, configurations, relative, inputs, outputs, seed):
    rng = np.random.default_rng(seed)
    n_conf, n_freq, n_out, n_in = response.shape
    level = relative * np.median(np.abs(response), axis=-1)
    covariance = np.zeros((n_conf, n_freq, n_out, n_out), complex)
    covariance[..., np.arange(n_out), np.arange(n_out)] = level**2
    deviation = rng.normal(size=(2, *response.shape)) / np.sqrt(2)
    return Frf(
        frequency_hz=frequency_hz,
        lines=np.arange(n_freq),
        configurations=configurations,
        response=response + level[..., None] * (deviation[0] + 1j * deviation[1]),
        input_factor=np.broadcast_to(np.eye(n_in, dtype=complex), (n_conf, n_freq, n_in, n_in)),
        element_scale=np.ones((n_conf, n_out, n_in)),
        total_covariance=covariance,
        noise_covariance=0.25 * covariance,
        total_degrees_of_freedom=36.0,
        noise_degrees_of_freedom=0.0,
        sensitivity=np.zeros((n_conf, 0, n_freq, n_out, n_in), complex),
        coefficient_names=(),
        coefficient_relative_std=np.zeros(0),
        removed_torque_rms=np.full((n_conf, n_in), 1.4),
        sampling_period_s=1e-3,
        input_channels=motor_channels(inputs, "torque"),
        output_channels=motor_channels(outputs, "acceleration"),
        notes=("Friction was subtracted with the robot file's coefficients.",),
        coherence=np.broadcast_to(1 - 1e-4 * np.geomspace(1, 9, n_freq)[:, None], (n_conf, n_freq, n_out)),
        silent_lines=np.arange(2 * n_freq),
        silent_level=np.repeat(level, 2, axis=1) * np.where(np.arange(2 * n_freq) % 2, 0.7, 0.2)[:, None],
        silent_noise=np.repeat(level, 2, axis=1) / 10,
        silent_interpolation=np.zeros((n_conf, 2 * n_freq, n_out)),
        uncompensated_response=1.2 * response,
    )


def arm_data(n_conf, n_freq, seed, relative=0.05):
    frequency_hz = np.geomspace(2, 80, n_freq)
    configurations = np.random.default_rng(seed).uniform(-1.5, 1.5, (n_conf, 6))
    stiffness = np.array([69.0, 45.0, 38.0, 22.0, 18.0, 12.0])
    damping = np.full(6, 0.05)
    true = np.array([elastic_arm_response(frequency_hz, angles, stiffness, damping) for angles in configurations])
    model = np.array(
        [elastic_arm_response(frequency_hz, angles, 1.01 * stiffness, 1.2 * damping) for angles in configurations]
    )
    return synthetic_frf(true, frequency_hz, configurations, relative, AXES, AXES, seed), model


def arm_parameters():
    rng = np.random.default_rng(3)
    names = [f"gear_{number}" for number in range(1, 7)]
    names += [f"bearing_{number}{axis}" for number in (1, 2, 3) for axis in "xy"] + ["forearm"]
    rows = []
    for kind, unit, base, std in (("stiffness", "N m/rad", 4.6e6, 0.006), ("damping", "N m s/rad", 2.0e3, 0.06)):
        for index, name in enumerate(names):
            nominal = base * 0.7**index
            truth = nominal * 2 ** rng.uniform(-1, 1)
            relative = (
                0.55
                if (kind, name) in {("damping", "bearing_1y"), ("damping", "bearing_3y")}
                else std * rng.uniform(0.5, 2)
            )
            estimate = truth * np.exp(relative * rng.normal())
            lower, upper = estimate * np.exp(np.array([-1.96, 1.96]) * relative)
            rows.append(
                ParameterRow(
                    name=name,
                    kind=kind,
                    unit=unit,
                    nominal=nominal,
                    estimate=estimate,
                    lower=lower,
                    upper=upper,
                    relative_std=relative,
                    truth=truth,
                    identifiable=relative < 0.2,
                    identified=relative < 0.2,
                    covered=bool(lower <= truth <= upper),
                    assumed=kind == "damping" or index > 2,
                )
            )
    rows.extend(
        ParameterRow(f"viscous_{index + 1}", "viscous", "N m s/rad", 0.0, 2e-3 + 1e-4 * index, 1e-3, 3e-3, 0.2)
        for index in range(6)
    )
    for name, unit, estimate, half in (("level", "", 0.0321, 0.0012), ("lag", "samples", -0.25, 0.06)):
        interval = estimate - half, estimate + half
        rows.append(ParameterRow(f"axis_1.{name}", "friction", unit, 0.0, estimate, *interval, half / 2, 0.031))
    open_row = ParameterRow(
        "axis_1.shape", "friction", "", 0.0, 0.4, -0.5, 1.3, 0.46, identifiable=False, identified=False
    )
    rows.append(open_row)
    rows.append(ParameterRow("delay", "delay", "s", 1.0e-3, 1.0021e-3, 1.0012e-3, 1.003e-3, 5e-4, 1.0e-3, True, False))
    return tuple(rows)


def arm_resonances(n_conf):
    rng = np.random.default_rng(5)
    rows = []
    for configuration in range(n_conf):
        for index, channel in enumerate(AXES):
            for kind, base in (("antiresonance", 9.0), ("resonance", 14.0)):
                measured = base * (1 + 0.25 * index) * (1 + 0.05 * rng.normal())
                model = measured * (1 + 0.006 * rng.normal())
                interval = (measured * 0.99, measured * 1.01) if index < 5 else None
                rows.append(ResonanceRow(configuration, channel, kind, measured, model, interval, model, damping=0.034))
    return (*rows, ResonanceRow(0, "axis_6", "resonance", None, 61.37, None, None))


SPRINGS = tuple(f"gear_{number}" for number in range(1, 7))


def arm_modes(resonances, n_conf):
    """A mode for each of the first three axes' resonances, and one that nothing shows, of an arm of five points."""
    points = np.array(
        [[0, 0, 0], [0, 0, 0.7], [0.4, 0, 1.7], [1.5, 0, 1.9], [1.8, 0, 1.9], [1.8, 0, 2.05], [1.8, 0.15, 1.9]]
    )
    modes = []
    for configuration in range(n_conf):
        own = [row for row in resonances if row.configuration == configuration and row.kind == "resonance"]
        hertz = np.array([row.mode_hz for row in own[:3]] + [77.7])
        shape = np.zeros((4, len(points), 3), complex)
        for mode in range(4):
            shape[mode, 1 + mode // 2 :, mode % 3] = np.linspace(0, 1, 6 - mode // 2) * np.exp(0.2j * mode)
        energy = np.full((4, 6), 0.004)
        energy[np.arange(4), np.arange(4)] = 0.7
        energy[np.arange(4), np.arange(1, 5)] = 0.284
        modes.append(ArmModes(hertz, np.full(4, 0.034), energy, points, shape, 3.3))
    return tuple(modes)


def residuals_of(frf, model):
    """Residuals where the weights allow for a model error of 2 %."""
    plain = compare_lines(frf.response, model, np.sqrt(frf.element_variance()))
    allowed = np.hypot(plain.noise, 0.02)
    return replace(plain, deviations=plain.relative / allowed, noise_deviations=plain.noise / allowed)


def arm_covariance(rows):
    """Independent parameters, but for two springs that go together and two dampers against each other."""
    correlation = np.eye(len(rows))
    for one, other, value in ((0, 1, 0.98), (13, 14, -0.97)):
        correlation[one, other] = correlation[other, one] = value
    std = np.array([row.relative_std * max(abs(row.estimate), 1e-9) for row in rows])
    return correlation * np.outer(std, std)


def arm_fit(n_conf, n_validation, n_freq):
    rng = np.random.default_rng(11)
    rows, resonances = arm_parameters(), arm_resonances(n_conf)
    peaks = tuple(
        Peak(row.channel, row.configuration, row.measured_hz)
        for row in resonances
        if row.kind == "resonance" and row.measured_hz
    )
    frf, model = arm_data(n_conf, n_freq, 1)
    validation, validation_model = arm_data(n_validation, n_freq, 2)
    estimation_costs = [
        CostRow("estimation", i, c, 0.0191, c - 0.0191) for i, c in enumerate(0.02 + 0.004 * rng.random(n_conf))
    ]
    validation_costs = [
        CostRow("validation", i, c, 0.0191, c - 0.0191) for i, c in enumerate(0.022 + 0.01 * rng.random(n_validation))
    ]
    return FitContent(
        name="elastic",
        campaign="estimation",
        frf=frf,
        model_response=model,
        estimates=Estimates(rows, identifiable_relative_std=0.2, covariance=arm_covariance(rows)),
        resonances=resonances,
        estimation_costs=tuple(estimation_costs),
        validation_costs=tuple(validation_costs),
        starts=tuple(
            StartRow(i, 0.02131 if i % 7 else 0.0417, 14 + i, "converged", 0 if i % 7 or i == 0 else 1)
            for i in range(1, 21)
        ),
        status="converged after 17 iterations",
        advice="",
        validation_campaign="validation",
        validation_frf=validation,
        validation_model=validation_model,
        views=FittedViews(
            arm_modes(resonances, n_conf),
            SPRINGS,
            residuals_of(frf, model),
            residuals_of(validation, validation_model),
            peaks,
        ),
    )


@cache
def arm_report(n_conf=3, n_validation=2, n_freq=60):
    fit = arm_fit(n_conf, n_validation, n_freq)
    campaigns = (("estimation", fit.frf), ("validation", fit.validation_frf))
    return Sample(
        fit,
        title="kr300",
        verdict=Verdict(
            "All 13 springs and 11 of 13 dampers are identified; "
            "the model predicts unseen configurations to 1.4 times the noise.",
            "ok",
        ),
        robot="KUKA KR300 R2500 ultra, 150 kg",
        robot_notes=(
            "Geometry, masses and inertias: Weigand, Robot_Identification (MIT licence).",
            "The counterbalance of axis 2 has no published figures and is left out.",
        ),
        configurations=tuple(
            ConfigurationRow(name, i, tuple(q)) for name, frf in campaigns for i, q in enumerate(frf.configurations)
        ),
        excitations=(
            ExcitationRow(
                "estimation",
                60,
                2.0,
                80.0,
                2880.0,
                (20.0,),
                "rad/s",
                detection_lines=11,
                period_s=5.0,
                crest_factor=1.83,
                worst_snr_db=17.3,
                peaks=tuple(
                    PeakRow(axis, what, unit, limit * share, limit, limit * share / 4)
                    for axis, share in zip(AXES, (0.31, 0.42, 0.93, 0.55, 0.6, 1.08), strict=True)
                    for what, unit, limit in (("torque", "N m", 60.0), ("speed", "rad/s", 470.0))
                ),
            ),
            ExcitationRow("validation", 60, 2.0, 80.0, 720.0, (20.0, 18.0), "rad/s"),
        ),
        removed_torques=tuple(TorqueRow("estimation", axis, 0.73 + 0.1 * i) for i, axis in enumerate(AXES)),
        stages=(
            StageRow("design-excitation", "estimation/excitation.h5", "8a1f03c2", "11c09f7e", 0.62, "crest factor 1.8"),
            StageRow(
                "simulate-or-acquire",
                "estimation/record.h5",
                "b37d5510",
                "90ee41ab",
                71.4,
                "8 configurations, 4 realizations, 24 experiments each",
            ),
            StageRow("fit", "fits/elastic/model.h5", "5d02b3f1", "c2aa8890", None, "cost 0.0213"),
        ),
        warnings=("Compensation used friction coefficients known to 10 %; this is part of the intervals.",),
    )


@cache
def bench_report():
    frequency_hz = np.linspace(11, 250, 240)
    omega = 2 * np.pi * frequency_hz
    k, c, j1, j2 = 546.4, 0.05, 4.78e-3, 4.752e-3
    d1, d2, link = k + 1j * omega * c - omega**2 * j1, k + 1j * omega * c - omega**2 * j2, k + 1j * omega * c
    determinant = d1 * d2 - link**2
    response = (-(omega**2) * np.array([d2, link]) / determinant).T[None, :, :, None]
    frf = synthetic_frf(response, frequency_hz, np.zeros((1, 1)), 0.02, ("motor",), ("motor", "load"), 4)
    rows = (
        ParameterRow("coupling", "stiffness", "N m/rad", 500.0, 546.4, 545.0, 547.8, 0.0013),
        ParameterRow("motor", "motor_inertia", "kg m^2", 4e-3, 4.78e-3, 4.775e-3, 4.785e-3, 0.0005),
        ParameterRow(
            "gap",
            "damping",
            "N m s/rad",
            0.0,
            3e-9,
            0.0,
            float("inf"),
            float("inf"),
            identifiable=False,
            identified=False,
            note="no effect <here>",
        ),
    )
    fit = FitContent(
        "two_mass",
        "estimation",
        frf,
        response,
        estimates=Estimates(rows),
        estimation_costs=(CostRow("estimation", 0, 1.02),),
        resonances=(
            ResonanceRow(
                0,
                "motor",
                "antiresonance",
                53.97,
                53.99,
                (53.88, 54.06),
                53.95,
                (53.9, 54.0),
                0.01,
                53.94,
                (53.85, 54.03),
            ),
            ResonanceRow(0, "motor", "resonance", 76.21, 76.2),
        ),
        starts=(StartRow(0, 1.02, 9, "converged", 0),),
    )
    return Sample(
        fit,
        "motor bench",
        Verdict("The two-mass model explains the log, but </script> one damper is open.", "warn"),
        "two-inertia drive",
    )
