"""The one-axis haptic device of the paper: in closed loop, over many seeds, and its tables and figures beside ours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robid.arrays import FloatArray
from robid.pipeline.graph import Run
from robid.report.numbers import MISSING, percent, significant
from robid.report.section import Beside, Section, Table
from robid.studies.experiments import paper_figures
from robid.studies.janot2009 import seeded
from robid.studies.page import Asked, PartFound, table
from robid.studies.settings.parts import HAPTIC_PERIOD_S, SeededCase
from robid.studies.study import Content, Part, Results

FIRST_MOMENTS = ((1, 2),)


def _identify_haptic(case: SeededCase, seeds: range) -> Content:
    bench = bench_of(case)
    return seeded.judge_chunk(haptic_machine(bench), record(seeds, bench), case)


def bench_of(case: SeededCase) -> Bench:
    """Returns the device's loop and sensors as the settings say."""
    return Bench(duration_s=case.duration_s, quantum_rad=case.resolution_rad, torque_noise_nm=case.torque_noise_nm)


def haptic_machine(bench: Bench) -> seeded.Machine:
    """Returns the device as what is to be identified."""

    def simulate_loop(parameters: FloatArray) -> FloatArray:
        return simulate(parameters, bench)[0].T[..., None]

    return seeded.Machine(Device(), np.array(NOMINAL), FIRST_MOMENTS, simulate_loop, weighted=False)


def record(seeds: range, bench: Bench) -> seeded.Recording:
    """Simulates one device a seed: the zero of its encoder and its torque noise differ."""
    generators = [np.random.default_rng(seed) for seed in seeds]
    phase = np.array([generator.uniform(0, bench.quantum_rad) for generator in generators])
    position, torque = simulate(np.tile(NOMINAL, (len(seeds), 1)), bench, phase)
    noise = np.stack([generator.standard_normal(len(torque)) for generator in generators])
    seen, noisy = measured(position, bench, phase).T, torque.T + bench.torque_noise_nm * noise
    return seeded.Recording(bench.sampling_period_s, seen[..., None], noisy[..., None])


_PLAIN, _HUBER, _PAPERS_BEND = range(3)
_SIGMA = "sigma"


def _conclude_haptic(run: Run, case: SeededCase, results: Results) -> PartFound:
    found = {filters: seeded.gather(results, filters) for filters in seeded.FILTERS}
    paper = paper_figures(run.loaded)
    errors = seeded.errors_of(found["bad"])
    figures = seeded.verdict_figures("haptic", found) | {
        "haptic.iv.max_error_percent": float(errors.instruments.max()),
        "haptic.iv.max_excess": errors.excess,
        "haptic.ls.max_error_percent": float(errors.least_squares.max()),
    }
    # The first seed's variations of eq. 22, sigma among them, and Huber's passes.
    for filters, judged in found.items():
        figures |= {f"haptic.{filters}.e.{name}": value for name, value in variations(judged, _HUBER).items()}
        figures[f"haptic.{filters}.huber_iterations"] = float(judged.iterations[_HUBER])
    lead = (
        "Verdicts, and what the paper does not have: instrumental variables, whose instrument is the device simulated"
        " without noise, on the badly filtered data."
    )
    parts = (*seeded.verdict_parts(found, case), seeded.error_table(found["bad"], case.bad_cut_hz))
    seeds = Section(f"Haptic device over {case.seeds} seeds", lead, parts)
    return PartFound(figures, _ASKED, (_tables(found, case, paper), _figures(found, case), seeds))


_ASKED = {
    "haptic.good.sigma": Asked(0.008, 0.012),
    "haptic.bad.sigma": Asked(0.031, 0.047),
    **{f"haptic.{filters}.verdict_share": asked for filters, asked in seeded.VERDICTS.items()},
    "haptic.iv.max_error_percent": Asked(upper=5.0),
    "haptic.iv.max_excess": Asked(upper=1.0),
    "haptic.ls.max_error_percent": Asked(lower=20.0),
}


def variations(judged: seeded.Judged, row: int) -> dict[str, float]:
    """Relative variations (eq. 22) of one of Huber's estimates from least squares, by parameter and `sigma` [%]."""
    plain = np.append(judged.value[_PLAIN], judged.sigma[_PLAIN])
    other = np.append(judged.value[row], judged.sigma[row])
    relative = 100 * np.abs((plain - other) / plain)
    return dict(zip((*judged.names, _SIGMA), relative.tolist(), strict=True))


def _tables(found: Mapping[str, seeded.Judged], case: SeededCase, paper: Mapping[str, Any]) -> Section:
    shown = (
        ("Table 1: least squares", "good", _PLAIN),
        ("Table 2: Huber", "good", _HUBER),
        ("Table 3: least squares", "bad", _PLAIN),
        ("Table 4: Huber", "bad", _HUBER),
        ("Table 5: Huber with H = 0.2", "bad", _PAPERS_BEND),
    )
    cut, nominal = dict(zip(seeded.FILTERS, seeded.cuts(case), strict=True)), paper.get("nominal", {})
    tables = [
        _estimates(f"{title}, {cut[filters]:g} Hz", found[filters], row, paper.get(f"table_{number}", {}), nominal)
        for number, (title, filters, row) in enumerate(shown, 1)
    ]
    tables.append(_variation_table(found, case, paper))
    lead = (
        f"The device of the paper, simulated with its nominal values (MY1 as identified); seed {case.first_seed}."
        " Deviations are relative (eq. 9), by eq. 8 and 19 as the paper has them, which takes residuals for"
        " independent."
    )
    return Section("Haptic device: Tables 1 to 6", lead, (Beside(tuple(tables), columns=2), *_limits(found, case)))


def _estimates(
    title: str, judged: seeded.Judged, row: int, paper: Mapping[str, Any], nominal: Mapping[str, float]
) -> Table:
    value, deviation = paper.get("value", {}), paper.get("deviation", {})
    own = judged.value[row].tolist(), np.abs(judged.std[row] / judged.value[row]).tolist()
    rows = []
    for name, unit, estimate, relative in zip(judged.names, judged.units, *own, strict=True):
        printed = significant(nominal.get(name)), significant(value.get(name)), percent(deviation.get(name))
        rows.append((f"{name} [{unit}]", *printed, significant(estimate), percent(relative)))
    sigma = ("sigma [N m]", "", significant(paper.get(_SIGMA)), "", significant(float(judged.sigma[row, 0])), "")
    passes = ("passes", "", str(paper.get("iterations", MISSING)), "", str(int(judged.iterations[row])), "")
    heads = ("Parameter", "Nominal", "Paper", "Deviation", "Ours", "Deviation")
    return Table(heads, (*rows, sigma, *([passes] if row else [])), title=title)


def _variation_table(found: Mapping[str, seeded.Judged], case: SeededCase, paper: Mapping[str, Any]) -> Table:
    printed, below = paper.get("table_6", {}), paper.get("table_6_below", {})
    good, bad = (variations(found[filters], _HUBER) for filters in seeded.FILTERS)
    theirs = {name: percent(printed.get(name)) for name in bad} | {name: f"< {percent(below[name])}" for name in below}
    columns = (
        ("Variation", lambda name: f"%e({name})"),
        (f"Paper, {case.bad_cut_hz:g} Hz", lambda name: theirs[name]),
        (f"Ours, {case.bad_cut_hz:g} Hz", lambda name: percent(bad[name] / 100)),
        (f"{case.good_cut_hz:g} Hz", lambda name: percent(good[name] / 100)),
    )
    caption = (
        "Least squares against Huber (eq. 22). Of the paper's own figures eq. 22 gives 26 % for sigma; its 34 % is"
        " relative to Huber's."
    )
    return table(columns, bad, title="Table 6: relative variations", caption=caption)


def _limits(found: Mapping[str, seeded.Judged], case: SeededCase) -> tuple[Table, ...]:
    order = np.argsort(seeded.BENDS)[::-1]
    tables = []
    for filters, cut in zip(seeded.FILTERS, seeded.cuts(case), strict=True):
        judged = found[filters]
        each = [variations(judged, 1 + index) for index in order]
        rows = [(name, *(percent(round(one[name] / 100, 6)) for one in each)) for name in each[0]]
        rows.append(("passes", *(str(int(judged.iterations[1 + index])) for index in order)))
        heads = ("Variation", *(f"H = {seeded.BENDS[index]:g}" for index in order))
        tables.append(Table(heads, tuple(rows), title=f"Limits of H, {cut:g} Hz"))
    caption = (
        "Distance from least squares (eq. 22). Towards infinity Huber's estimator is least squares, towards 0 it"
        " minimises magnitudes: in the paper within 2 % at 20 Hz."
    )
    return (*tables[:-1], replace(tables[-1], caption=caption))


def _figures(found: Mapping[str, seeded.Judged], case: SeededCase) -> Section:
    good, bad = (found[filters] for filters in seeded.FILTERS)
    beyond = [percent(seeded.outlier_share(each)) for each in (good, bad)]
    first, second = (f"{cut:g} Hz" for cut in seeded.cuts(case))
    names = f"Fig. 2: residuals, {first}", f"Fig. 3: Huber's weights, {first}", ""
    spread, weights, _ = seeded.residual_figures(good, 0, names)
    names = f"Fig. 4: residuals, {second}", "", f"Fig. 5: course of the residuals, {second}"
    other, _, course = seeded.residual_figures(bad, 0, names)
    lead = (
        f"Least squares of seed {case.first_seed}. In the paper Fig. 2 is close to a Gaussian of 0.01 N m with few"
        " outliers, Fig. 3 is 1 in the middle and falls as one over the residual, Fig. 4 is no Gaussian, and Fig. 5"
        " often leaves the band of three deviations. Of ours"
        f" {beyond[0]} lie beyond three deviations at {first}, {beyond[1]} at {second}; of a Gaussian 0.27 %."
    )
    shown = Beside((spread, weights, other, course), columns=2)
    return Section("Haptic device: Figs 2 to 5", lead, (shown,))


GRAVITY = 9.81
NAMES = ("ZZ1", "MX1", "MY1", "fv1", "fc1")
NOMINAL = (1.45e-3, 2.40e-3, 1.00e-3, 1.50e-3, 67.0e-3)
"""Parameters of the paper's Table 1, in the order of `NAMES`; MY1 as identified there [SI]."""


@dataclass(frozen=True)
class Bench:
    """The device's loop and sensors."""

    sampling_period_s: float = HAPTIC_PERIOD_S  # Period of the controller and of the record [s]
    duration_s: float = 10.0  # Length of the record [s]
    loop_hz: float = 20.0  # Natural frequency of the position loop [Hz]
    damping: float = 0.7  # Its damping ratio
    inertia_kgm2: float = 1.45e-3  # Inertia that the loop was tuned for [kg m^2]
    quantum_rad: float = 2 * np.pi / 8192  # Encoder quantum [rad]
    torque_noise_nm: float = 0.09  # Standard deviation of the measured torque's white noise [N m]
    substeps: int = 2  # Integration steps per sampling period

    @property
    def gains(self) -> tuple[float, float]:
        """Gains on position and speed [N m/rad, N m s/rad]."""
        rate = 2 * np.pi * self.loop_hz
        return self.inertia_kgm2 * rate**2, 2 * self.damping * rate * self.inertia_kgm2


class Device:
    """The device's inverse dynamics, eq. 20."""

    names = NAMES
    kinds = ("inertia", "first_moment", "first_moment", "viscous", "coulomb")
    units = ("kg m^2", "kg m", "kg m", "N m s/rad", "N m")

    def columns(
        self,
        position: FloatArray,
        velocity: FloatArray,
        acceleration: FloatArray,
        *,
        torque: FloatArray | None = None,  # noqa: ARG002
        friction_speed: FloatArray | None = None,
        loaded: bool = True,  # noqa: ARG002
    ) -> FloatArray:
        """Returns one column a parameter (n_sample, 1, 5)."""
        sign = np.sign(velocity if friction_speed is None else friction_speed)
        gravity = (-GRAVITY * np.cos(position), GRAVITY * np.sin(position))
        return np.stack([acceleration, *gravity, velocity, sign], axis=-1)


def reference(time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns position and speed that the device is told to follow [rad, rad/s]."""
    position, speed = np.zeros_like(time_s), np.zeros_like(time_s)
    for amplitude, hertz, phase in ((0.5, 0.5, 0.0), (0.25, 1.3, 0.7), (0.15, 3.1, 2.0)):
        angle = 2 * np.pi * hertz * time_s + phase
        position += amplitude * np.sin(angle)
        speed += amplitude * 2 * np.pi * hertz * np.cos(angle)
    return position, speed


def measured(position: FloatArray, bench: Bench, phase_rad: FloatArray) -> FloatArray:
    """Returns what encoders with their own zero (n_device,) [rad] say of positions (..., n_device)."""
    return np.asarray(bench.quantum_rad * np.round((position - phase_rad) / bench.quantum_rad) + phase_rad)


def simulate(
    parameters: FloatArray, bench: Bench, phase_rad: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Simulates devices in closed loop, their parameters (n_device, 5) in the order of `NAMES`.

    Without zeros of the encoders (n_device,) the loop sees the motion itself, as an instrument does.

    Returns:
        True positions (n_sample, n_device) [rad] and commanded torques [N m], those held from that sample on.
    """
    n_sample = round(bench.duration_s / bench.sampling_period_s)
    wanted, wanted_speed = reference(np.arange(n_sample) * bench.sampling_period_s)
    inertia, moment_x, moment_y, viscous, coulomb = np.asarray(parameters).T
    step, (stiffness, damper) = bench.sampling_period_s / bench.substeps, bench.gains
    position, speed = (np.full(len(parameters), start[0]) for start in (wanted, wanted_speed))
    seen_before = position - wanted_speed[0] * bench.sampling_period_s
    positions, torques = np.empty((n_sample, len(parameters))), np.empty((n_sample, len(parameters)))
    lost = coulomb * step / inertia
    for sample in range(n_sample):
        seen = position if phase_rad is None else measured(position, bench, phase_rad)
        seen_speed = (seen - seen_before) / bench.sampling_period_s
        torque = stiffness * (wanted[sample] - seen) + damper * (wanted_speed[sample] - seen_speed)
        seen_before, positions[sample], torques[sample] = seen, position, torque
        for _ in range(bench.substeps):
            gravity = GRAVITY * (moment_x * np.cos(position) - moment_y * np.sin(position))
            free = speed + step * (torque + gravity - viscous * speed) / inertia
            speed = free - np.clip(free, -lost, lost)  # friction stops, it does not reverse
            position = position + step * speed
    return positions, torques


HAPTIC = Part(
    "haptic", _conclude_haptic, lambda _run, case, _earlier: seeded.chunk_tasks(case, "haptic", {}), _identify_haptic
)
