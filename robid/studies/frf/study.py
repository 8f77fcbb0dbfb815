"""The study of estimators: many small groups of realizations against the best linear approximation of all."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from robid.arrays import ComplexArray, FloatArray
from robid.artifacts.artifact import Artifact, Dataset
from robid.artifacts.kinds import EXCITATION
from robid.artifacts.store import read_header
from robid.errors import DataError
from robid.frf.laws import combine_laws
from robid.frf.options import IDENTIFYING, EstimateOptions
from robid.frf.silent import identify_laws, start_laws
from robid.pipeline.graph import Run
from robid.pipeline.simulate_or_acquire import simulated_experiment
from robid.report.numbers import MISSING, percent, significant
from robid.report.page import Verdict
from robid.report.section import Figure, Section
from robid.robot.friction import TorqueLaw
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.settings.experiment import Campaign
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import delay_s, plain_settings, require_controller
from robid.signals.quantities import units_text
from robid.signals.record import Record
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.simulate.options import SimulateOptions
from robid.simulate.truth import true_robot, with_imperfections
from robid.studies.experiments import excitations
from robid.studies.page import Conclusion, figure, table
from robid.studies.settings.study import FrfStudy, choices
from robid.studies.simulated import Estimator, make_estimator, played, simulate_options, simulation_settings, threads_of
from robid.studies.study import Content, Earlier, Task, study_of, values_of

_Outcome: TypeAlias = tuple[ComplexArray, FloatArray, str]
"""Response and variance of one estimate, NaN where it was refused, and why."""


def compared(study: FrfStudy, campaign: Campaign) -> list[EstimateOptions]:
    """Returns what is estimated from each group: every estimator, then every other compensation.

    Estimators are compared under the campaign's compensation, compensations with the campaign's estimator.
    """
    own = campaign.estimate
    estimators = dict.fromkeys([own.estimator, *(study.estimators or choices("estimator"))])
    others = [name for name in compensations(study, campaign) if name != own.compensation_kind]
    chosen = [replace(own, estimator=name) for name in estimators]  # type: ignore[arg-type]
    return chosen + [replace(own, compensation=name) for name in others]  # type: ignore[arg-type]


def compensations(study: FrfStudy, campaign: Campaign) -> list[str]:
    """Returns the compensations to compare, the campaign's own among them."""
    named = study.compensations or choices("compensation")
    return list(dict.fromkeys([*named, campaign.estimate.compensation_kind]))


def campaign_of(loaded: LoadedExperiment) -> tuple[FrfStudy, Campaign, SimulateOptions]:
    """Returns the study, its campaign, and how that is simulated."""
    study = study_of(loaded, FrfStudy)
    campaign = loaded.experiment.campaigns[study.campaign]
    return study, campaign, simulate_options(campaign)


def needs(loaded: LoadedExperiment) -> tuple[str, ...]:
    """Returns the outputs of the chain that the tasks read."""
    return excitations((campaign_of(loaded)[0].campaign,))


def tasks(run: Run, _earlier: Earlier) -> list[Task]:
    """Returns one task for each configuration and chunk of realizations."""
    study, campaign, options = campaign_of(run.loaded)
    path, excitation = run.path(needs(run.loaded)[0]), played(run, study.campaign)
    whole = simulated_experiment(run.loaded, campaign, options, excitation)
    decides = {
        "excitation": read_header(path, EXCITATION).content_sha256,
        **simulation_settings(run.loaded, campaign),
        **{"group": study.group, "groups_per_task": study.groups_per_task},
        "estimates": plain_settings(compared(study, campaign)),
        "references": plain_settings(reference_options(study, campaign)),
    }
    small = tuple(make_estimator(run.loaded, campaign, each) for each in compared(study, campaign))
    large = tuple(make_estimator(run.loaded, campaign, each) for each in reference_options(study, campaign))
    length = study.group * study.groups_per_task
    found = []
    for index, configuration in enumerate(excitation.configurations):
        for number, start in enumerate(range(0, campaign.realizations, length)):
            seeded = replace(options, seed=int(np.random.SeedSequence([options.seed, number]).generate_state(1)[0]))
            part = replace(whole, reference=whole.reference[start : start + length], options=seeded)
            arguments = part, configuration, index, study.group, small, large, threads_of(run)
            place = {"configuration": index, "chunk": number}
            found.append(Task(f"configuration_{index + 1}_chunk_{number + 1}", {**decides, **place}, arguments))
    return found


def reference_options(study: FrfStudy, campaign: Campaign) -> list[EstimateOptions]:
    """Returns how the best linear approximation is estimated, once per compensation."""
    own = replace(campaign.estimate, estimator=study.reference_estimator)  # type: ignore[arg-type]
    return [replace(own, compensation=name) for name in compensations(study, campaign)]  # type: ignore[arg-type]


def estimate_chunk(
    experiment: SimulatedExperiment,
    configuration: FloatArray,
    index: int,
    group: int,
    small_estimators: tuple[Estimator, ...],
    whole_estimators: tuple[Estimator, ...],
    threads: int,
) -> Content:
    """Simulates some realizations in one configuration, and estimates from each of their groups and from all."""
    record = simulate(experiment, configuration, index, threads)
    n_real = record.inputs.shape[1]
    groups = [record.realizations(group, at) for at in range(0, n_real, group)]
    identified = _identified(groups[0], (*small_estimators, *whole_estimators))
    small = [[_estimate(part, each, identified) for part in groups] for each in small_estimators]
    whole = [_estimate(record, each, identified) for each in whole_estimators]
    element = ("frequency", "output", "input")
    unit = f"rad/(s^2 {units_text(record.input_channels)})"
    refused = [next((reason for *_, reason in row if reason), "") for row in (*small, whole)]
    response, variance = (np.array([[one[at] for one in row] for row in small]) for at in (0, 1))
    datasets = {
        "configuration": Dataset(np.array(index), "1", ()),
        "angles": Dataset(configuration, "rad", ("joint",)),
        "frequency_hz": Dataset(record.frequency_hz, "Hz", ("frequency",)),
        "response": Dataset(response, unit, ("estimate", "group", *element)),
        "variance": Dataset(variance, f"({unit})^2", ("estimate", "group", *element)),
        "whole": Dataset(np.array([one[0] for one in whole]), unit, ("compensation", *element)),
        "realizations": Dataset(np.array(n_real), "1", ()),
        "refusals": Dataset(np.array(refused, dtype=str), "1", ("reason",), "First refusal of each; last: of whole"),
    }
    return Content(datasets)


def _identified(record: Record, estimators: tuple[Estimator, ...]) -> tuple[TorqueLaw, ...] | str | None:
    """Laws that the silent lines of a group show, why there are none, or None where nobody asks."""
    asking = [each for each in estimators if each.options.compensation_kind in IDENTIFYING]
    if not asking or asking[0].laws is None:
        return None
    stated, delay = asking[0].laws, asking[0].delay_s
    try:
        start = start_laws(record, stated, delay)
        return combine_laws([identify_laws(record, start, delay)], start, stated, record.input_names)[0]
    except DataError as error:
        return error.what


def _estimate(record: Record, estimator: Estimator, identified: tuple[TorqueLaw, ...] | str | None) -> _Outcome:
    laws = identified if estimator.options.compensation in IDENTIFYING else estimator.laws
    if isinstance(laws, str) and estimator.options.compensation == "auto":
        laws = estimator.laws
    if isinstance(laws, str):
        return _refused(record, laws)
    try:
        frf = replace(estimator, laws=laws).estimate(record)
    except DataError as error:
        return _refused(record, error.what)
    return frf.response[0], frf.element_variance()[0], ""


def _refused(record: Record, reason: str) -> _Outcome:
    shape = (len(record.excited_lines), len(record.output_names), len(record.input_names))
    return np.full(shape, complex(np.nan, np.nan)), np.full(shape, np.nan), reason


@dataclass(frozen=True)
class Scatter:
    """How one estimator's estimates lie about a reference, per configuration, line and element.

    Every field has the shape (n_conf, n_freq, n_out, n_in); NaN where fewer than two estimates were made.
    """

    error: FloatArray  # Root mean square over the estimates of `|G_hat - G_ref| / |G_ref|`
    bias: FloatArray  # `|mean(G_hat) - G_ref| / |G_ref|`
    std_ratio: FloatArray  # Root of the mean reported variance over the standard deviation of the estimates


def scatter(estimates: ComplexArray, variance: FloatArray, reference: ComplexArray) -> Scatter:
    """Compares estimates with a reference (n_conf, n_freq, n_out, n_in), and their spread with what they report.

    Independent estimates, NaN where one was refused, and the variance that each reports, `E|G_hat - G|^2`, are (n_conf,
    n_estimate, n_freq, n_out, n_in).
    """
    count, size = np.isfinite(estimates).sum(axis=1), np.abs(reference)
    enough, mean = count > 1, _mean(estimates, count)
    error = np.sqrt(_mean(np.abs(estimates - reference[:, None]) ** 2, count)) / size
    spread = _mean(np.abs(estimates - mean[:, None]) ** 2, count) * count / np.maximum(count - 1, 1)
    reported = _mean(variance, count)
    ratio = np.sqrt(np.divide(reported, spread, out=np.full_like(spread, np.nan), where=enough & (spread > 0)))
    return Scatter(np.where(enough, error, np.nan), np.where(enough, np.abs(mean / reference - 1), np.nan), ratio)


def error_ratio(
    first: ComplexArray, second: ComplexArray, reference: ComplexArray, *, draws: int = 200, seed: int = 1
) -> tuple[float, float, float]:
    """Median error of one estimator over another's, with the 95 % interval of a bootstrap over the estimates.

    Estimates (n_conf, n_estimate, n_freq, n_out, n_in) from the same data should be the reference (n_conf, n_freq,
    n_out, n_in).

    Returns:
        Ratio, lower and upper end; NaN where the two share no estimate.
    """
    both = np.isfinite(first).all(axis=(0, 2, 3, 4)) & np.isfinite(second).all(axis=(0, 2, 3, 4))
    if both.sum() < 2:
        return np.nan, np.nan, np.nan
    whole, count = reference[:, None], int(both.sum())
    off = ((np.abs(each[:, both] - whole) / np.abs(whole)) ** 2 for each in (first, second))
    squares = [np.moveaxis(each, 1, 0).reshape(count, -1) for each in off]

    def ratio(weights: FloatArray) -> float:
        ours, theirs = (np.median(np.sqrt(weights @ square)) for square in squares)
        return float(ours / theirs)

    weights = np.random.default_rng(seed).multinomial(count, np.full(count, 1 / count), draws) / count
    ends = np.quantile([ratio(row) for row in weights], [0.025, 0.975])
    return ratio(np.full(count, 1 / count)), float(ends[0]), float(ends[1])


def elements(values: FloatArray, *, diagonal: bool) -> FloatArray:
    """Returns the elements on the diagonal, or those off it, with the two matrix axes flattened to one."""
    row, column = np.indices(values.shape[-2:])
    return np.asarray(values[..., (row == column) if diagonal else (row != column)])


def _mean(values: ComplexArray | FloatArray, count: NDArray[np.int_]) -> ComplexArray | FloatArray:
    return np.asarray(np.where(np.isfinite(values), values, 0).sum(axis=1) / np.maximum(count, 1))


@dataclass(frozen=True)
class Found:
    """The tasks' results of all configurations together."""

    frequency_hz: FloatArray  # (n_freq,) excited frequencies [Hz]
    configurations: FloatArray  # (n_conf, n_joint) arm-side joint angles [rad]
    # (n_estimate, n_conf, n_group, n_freq, n_out, n_in) each group's estimates; NaN where refused
    response: ComplexArray
    variance: FloatArray  # Variance that each reports, of the same shape
    # (n_compensation, n_conf, n_freq, n_out, n_in) best linear approximation from all realizations
    whole: ComplexArray
    refusals: tuple[str, ...]  # (n_estimate + 1,) first reason of a refusal, or ""; that of `whole` last


def gather(results: Sequence[Artifact]) -> Found:
    """Puts the tasks' results together, those of one configuration along the groups."""
    values = [values_of(result) for result in results]
    index = np.array([int(one["configuration"]) for one in values])
    rows = [[values[at] for at in np.flatnonzero(index == chosen)] for chosen in np.unique(index)]

    def joined(name: str) -> Any:  # noqa: ANN401
        return np.stack([np.concatenate([one[name] for one in row], axis=1) for row in rows], axis=1)

    counts = [[float(one["realizations"]) for one in row] for row in rows]
    means = zip(rows, counts, strict=True)
    whole = [np.average([one["whole"] for one in row], axis=0, weights=count) for row, count in means]
    reasons = zip(*(one["refusals"].tolist() for one in values), strict=True)
    return Found(
        frequency_hz=values[0]["frequency_hz"],
        configurations=np.array([row[0]["angles"] for row in rows]),
        response=joined("response"),
        variance=joined("variance"),
        whole=np.stack(whole, axis=1),
        refusals=tuple(next((reason for reason in each if reason), "") for each in reasons),
    )


def true_response(loaded: LoadedExperiment, found: Found) -> ComplexArray:
    """Returns the response of the true robot's frictionless linearisation (n_conf, n_freq, n_motor, n_motor)."""
    _, campaign, options = campaign_of(loaded)
    true = true_robot(loaded.robot.to_robot(campaign.payload_kg), options.truth)
    robot = with_imperfections(true, options.imperfections)
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, found.configurations))
    parameters = nominal_parameters(robot, linear, delay_s(loaded, campaign))
    period_s = require_controller(loaded).sampling_period_s
    return response(linear, parameters, found.frequency_hz, period_s).sampled


@dataclass(frozen=True)
class Compared:
    """One estimator against the best linear approximation, or one compensation against the truth."""

    name: str  # Name of the estimator or of the compensation
    error_hz: FloatArray  # (n_freq,) median error, or bias, on the diagonal at each line
    figures: dict[str, float]  # Figures by name, as they stand in summary.json
    # (n_freq,) median ratio of reported to true standard deviation there, of an estimator
    std_ratio_hz: FloatArray | None = None


def estimator_figures(
    name: str, estimates: ComplexArray, variance: FloatArray, reference: ComplexArray, default: ComplexArray
) -> Compared:
    """Compares an estimator with the best linear approximation (n_conf, n_freq, n_out, n_in), and with the default one.

    Estimates, NaN where refused, and the variance that each reports are (n_conf, n_group, n_freq, n_out, n_in).
    """
    found = scatter(estimates, variance, reference)
    figures = {"median_bias": _quantile(found.bias, 0.5)}
    parts = {"": (found.error, found.std_ratio)}
    for part, diagonal in (("diagonal.", True), ("off_diagonal.", False)):
        parts[part] = elements(found.error, diagonal=diagonal), elements(found.std_ratio, diagonal=diagonal)
    for part, (error, std_ratio) in parts.items():
        figures[f"{part}median_error"], figures[f"{part}q90_error"] = (_quantile(error, share) for share in (0.5, 0.9))
        figures[f"{part}std_ratio"] = _quantile(std_ratio, 0.5)
    ratio = error_ratio(estimates, default, reference)
    figures |= dict(zip(("over_default", "over_default_lower", "over_default_upper"), ratio, strict=True))
    figures["refused"] = float(np.isnan(estimates).any(axis=(2, 3, 4)).sum())
    return Compared(name, _per_line(found.error), figures, _per_line(found.std_ratio))


def bias_figures(name: str, whole: ComplexArray, estimates: ComplexArray, truth: ComplexArray) -> Compared:
    """Compares responses under one compensation with the true robot's linearisation (n_conf, n_freq, n_out, n_in).

    Estimates are those of the groups (n_conf, n_group, n_freq, n_out, n_in), `whole` that of all, NaN where refused.
    """
    bias = np.abs(whole / truth - 1)
    diagonal, single = (elements(each, diagonal=True) for each in (bias, np.abs(estimates / truth[:, None] - 1)))
    figures = {
        "median_diagonal": _quantile(diagonal, 0.5),
        "q90_diagonal": _quantile(diagonal, 0.9),
        "median_off_diagonal": _quantile(elements(bias, diagonal=False), 0.5),
        "median_diagonal_of_group": _quantile(single, 0.5),
        "refused": float(np.isnan(estimates).any(axis=(2, 3, 4)).sum()),
    }
    return Compared(name, _per_line(bias), figures)


def _per_line(values: FloatArray) -> FloatArray:
    """Median over configurations and diagonal elements (n_freq,) of values (n_conf, n_freq, n_out, n_in)."""
    return np.asarray(np.median(elements(values, diagonal=True), axis=(0, 2)))


def _quantile(values: FloatArray, share: float) -> float:
    known = values[np.isfinite(values)]
    return float(np.quantile(known, share)) if known.size else float("nan")


_WORTH = 0.98  # another estimator is worth a new default only where its error is surely below this share


def conclude(run: Run, results: Earlier) -> Conclusion:
    """Turns the tasks' results into figures, tables and the default that follows."""
    loaded, found = run.loaded, gather(list(results[0]))
    study, campaign, _ = campaign_of(loaded)
    own, kinds = campaign.estimate, compensations(study, campaign)
    place: dict[tuple[str, str], int] = {
        (each.estimator, each.compensation_kind): index for index, each in enumerate(compared(study, campaign))
    }
    reference = found.whole[kinds.index(own.compensation_kind)]
    default = found.response[place[own.estimator, own.compensation_kind]]
    estimators = [
        estimator_figures(name, found.response[index], found.variance[index], reference, default)
        for (name, kind), index in place.items()
        if kind == own.compensation_kind
    ]
    truth = true_response(loaded, found)
    biases = [
        bias_figures(kind, found.whole[index], found.response[place[own.estimator, kind]], truth)
        for index, kind in enumerate(kinds)
    ]
    names = [f"{name} with compensation {kind}" for name, kind in place]
    refusals = zip([*names, f"{study.reference_estimator}, from all realizations,"], found.refusals, strict=True)
    summary = {f"frf.{one.name}.{key}": value for one in estimators for key, value in one.figures.items()}
    summary |= {f"bias.{one.name}.{key}": value for one in biases for key, value in one.figures.items()}
    summary |= {"frf.groups": found.response.shape[2], "frf.configurations": found.response.shape[1]}
    frequency = found.frequency_hz
    left = ", ".join(f"{percent(one.figures['median_diagonal'])} with compensation {one.name}" for one in biases)
    return Conclusion(
        verdict=Verdict(f"{default_sentence(estimators, own.estimator)} Median bias on the diagonal: {left}.", "ok"),
        summary={name: value for name, value in summary.items() if math.isfinite(value)},
        sections=(
            _estimator_section(estimators, frequency, campaign, study.group),
            _bias_section(biases, frequency, study.group, campaign.realizations),
        ),
        warnings=tuple(f"{name} refused: {reason}." for name, reason in refusals if reason),
    )


def following_default(estimators: Sequence[Compared], default: str) -> str:
    """Returns the estimator that follows as the default: another one only where it is surely and markedly closer."""
    closer = [one for one in estimators if one.figures["over_default_upper"] < _WORTH]
    return min(closer, key=lambda one: one.figures["over_default"]).name if closer else default


def default_sentence(estimators: Sequence[Compared], default: str) -> str:
    """Says which estimator follows as the default, and by how much."""
    follows = following_default(estimators, default)
    others = [one for one in estimators if one.name != default and math.isfinite(one.figures["over_default"])]
    if not others:
        return f"Estimator {default} stays the default: nothing else was compared."
    if follows != default:
        best = next(one for one in others if one.name == follows)
        return f"Estimator {follows} should be the default: its error is {_share(best)} of that of {default}."
    best = min(others, key=lambda one: one.figures["over_default"])
    return f"Estimator {default} stays the default: the error of the best other, {best.name}, is {_share(best)} of it."


def _share(one: Compared) -> str:
    figures = one.figures
    if not math.isfinite(figures["over_default"]):
        return MISSING
    ends = f"{significant(figures['over_default_lower'])} … {significant(figures['over_default_upper'])}"
    return f"{significant(figures['over_default'])} ({ends})"


def _estimator_section(
    estimators: Sequence[Compared], frequency: FloatArray, campaign: Campaign, group: int
) -> Section:
    lead = (
        f"Estimates from {group} realizations against the best linear approximation from all {campaign.realizations},"
        f" with compensation {campaign.estimate.compensation_kind}."
    )
    columns = (
        ("Estimator", lambda one: one.name),
        ("Diagonal, median", lambda one: percent(one.figures["diagonal.median_error"])),
        ("90 %", lambda one: percent(one.figures["diagonal.q90_error"])),
        ("Off diagonal, median", lambda one: percent(one.figures["off_diagonal.median_error"])),
        ("90 %", lambda one: percent(one.figures["off_diagonal.q90_error"])),
        ("Bias, median", lambda one: percent(one.figures["median_bias"])),
        ("Reported over true deviation", lambda one: significant(one.figures["std_ratio"])),
        ("Error over the default's", _share),
        ("Refused", lambda one: f"{one.figures['refused']:.0f}"),
    )
    caption = (
        f"Root mean square of the relative error over the groups of {group} realizations; median and 90 % quantile"
        " over lines, elements and configurations. Bias: of the mean over the groups. Reported over true deviation:"
        " 1 where the covariance is honest. Error over the default's: ratio of the medians with its 95 % interval"
        " from a bootstrap over the groups. Stressed: the default that follows."
    )
    follows = following_default(estimators, campaign.estimate.estimator)
    strong = [one.name for one in estimators].index(follows)
    honesty = {one.name: one.std_ratio_hz for one in estimators}
    parts = (
        table(columns, estimators, caption=caption, strong=strong),
        _figure("Error on the diagonal", "Relative error, median", frequency, _errors(estimators)),
        _figure("Reported over true standard deviation, diagonal", "Ratio, median", frequency, honesty, log_y=False),
    )
    return Section("Estimators", lead, parts)


def _bias_section(biases: Sequence[Compared], frequency: FloatArray, group: int, realizations: int) -> Section:
    columns = (
        ("Compensation", lambda one: one.name),
        ("Diagonal, median", lambda one: percent(one.figures["median_diagonal"])),
        ("90 %", lambda one: percent(one.figures["q90_diagonal"])),
        ("Off diagonal, median", lambda one: percent(one.figures["median_off_diagonal"])),
        (f"Diagonal, median of {group} realizations", lambda one: percent(one.figures["median_diagonal_of_group"])),
        ("Refused", lambda one: f"{one.figures['refused']:.0f}"),
    )
    caption = (
        f"Last but one: distance of a single estimate, its scatter included. What silent_lines"
        f" subtracts is identified from the first {group} realizations of each task, in one configuration."
    )
    lead = (
        f"Best linear approximation from {realizations} realizations against the true robot's linearisation without"
        " friction: |G_hat/G - 1| with each compensation of the friction."
    )
    shown = _figure("Bias on the diagonal", "Relative bias, median", frequency, _errors(biases))
    return Section("Compensation", lead, (table(columns, biases, caption=caption), shown))


def _errors(compared: Sequence[Compared]) -> dict[str, FloatArray]:
    return {one.name: one.error_hz for one in compared}


def _figure(
    title: str, y_title: str, frequency: FloatArray, series: Mapping[str, FloatArray | None], *, log_y: bool = True
) -> Figure:
    known = {name: values for name, values in series.items() if values is not None and np.isfinite(values).any()}
    return figure(title, ("Frequency [Hz]", y_title), frequency, known, log_y=log_y)
