"""The figures of the study of configurations, and which models are surely better than the optimal one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.artifacts.artifact import Artifact
from robid.artifacts.kinds import DESIGN, design_from_artifact
from robid.artifacts.store import read_artifact
from robid.design.configurations.information import ConfigurationDesign
from robid.pipeline.graph import Run
from robid.studies.over_individuals import Mean, differs, over_springs, scatter, scatter_error, scatters_differ
from robid.studies.settings.elastic import ZimmermannStudy
from robid.studies.study import Earlier, study_of
from robid.studies.tasks import values_of
from robid.studies.zimmermann2023.effort import EffortCurves, effort_curves
from robid.studies.zimmermann2023.models import owners_of_sets, pairs
from robid.studies.zimmermann2023.steps import StepResponses, read_steps, step_figures

MISSED = 0.03
"""Relative error from which a first resonance counts as missed."""
_BENT = 0.01
"""Spread of a spring's slope over the configurations from which gravity counts as bending it."""


@dataclass(frozen=True)
class Model:
    """One model of all individuals; arrays begin with (n_seed, ...)."""

    name: str
    used: tuple[int, ...]  # Indices of its configurations, of the first individual
    wanted: tuple[str, ...]  # Springs that deviations are given of
    std: FloatArray  # (n_seed, n_wanted) relative deviation by the total covariance: the floor that noise sets
    fit_std: FloatArray  # (n_seed, n_wanted) deviation of the springs themselves that the fit's intervals state
    effective_std: FloatArray  # (n_seed, n_wanted) that of what infinitely many configurations would give
    # (n_seed, n_set, n_wanted) logarithm of the middle of each spring's interval over its true linear stiffness, from
    # its configurations and, where these were drawn, from further sets that share none
    error: FloatArray
    fit_error: FloatArray  # (n_seed, n_set, n_wanted) the same of the fitted springs, which predict
    stiffness: FloatArray  # (n_seed, n_spring) springs [N m/rad]
    cost: FloatArray  # (n_seed, n_conf) weighted log-amplitude error per element
    expected: FloatArray  # (n_seed, n_conf) what noise alone gives
    # (n_seed, n_conf, n_axis) relative error of first resonances; NaN without a counterpart
    resonance_error: FloatArray
    # (n_seed, n_conf, n_spring) slopes under gravity and excitation of gears that stiffen, or None
    slope: FloatArray | None

    @property
    def average_std(self) -> FloatArray:
        """Mean relative deviation of the springs (n_seed,)."""
        return np.asarray(self.std.mean(axis=1))

    def stated(self, mean: Mean) -> FloatArray:
        """Mean over the springs of the deviation that the fit states (n_seed,)."""
        return over_springs(self.fit_std, mean)

    @property
    def average_cost(self) -> FloatArray:
        """Mean cost over the configurations (n_seed,)."""
        return np.asarray(self.cost.mean(axis=1))

    @property
    def average_excess(self) -> FloatArray:
        """Mean cost above that of noise alone (n_seed,)."""
        return np.asarray((self.cost - self.expected).mean(axis=1))

    @property
    def missed(self) -> BoolArray:
        """First resonances (n_seed, n_conf, n_axis) that are off by more than 3 %, or that the model does not have."""
        return np.asarray(~(np.abs(self.resonance_error) <= MISSED))


@dataclass(frozen=True)
class Found:
    """All that the tasks found."""

    study: ZimmermannStudy
    models: dict[str, Model]  # The models by name
    springs: tuple[str, ...]  # Names of all springs
    truth: FloatArray  # (n_seed, n_spring) true linear stiffness [N m/rad]
    there: BoolArray  # (n_seed, n_conf, n_axis) whether the measurement shows a first resonance
    design: ConfigurationDesign  # The design of the study
    effort: EffortCurves  # Deviations over the number of experiments
    steps: tuple[StepResponses, ...]  # Responses to steps of each individual; empty where nothing was stepped
    first: dict[str, dict[str, Any]]  # Arrays of the first individual's models, for drawing, by model and dataset

    @property
    def small(self) -> list[str]:
        """Models that have no more configurations than the optimal one, the nonlinear one left out."""
        most = len(self.models[self.study.optimal].used)
        return [name for name, one in self.models.items() if len(one.used) <= most and name != self.study.nonlinear]


def gather(run: Run, earlier: Earlier) -> Found:
    """Puts the tasks' results together."""
    study, names = study_of(run.loaded, ZimmermannStudy), list(study_of(run.loaded, ZimmermannStudy).models)
    results = [_values(result) for result in earlier[1]]
    by_model = {name: results[index :: len(names)] for index, name in enumerate(names)}
    further = _further_sets(run, study, earlier)
    models = {name: _model(name, rows, further.get(name, [])) for name, rows in by_model.items()}
    reference = by_model[study.reference]
    design = design_from_artifact(read_artifact(run.path(f"designs/{study.design}.h5"), DESIGN))
    campaign = run.loaded.experiment.campaigns[study.estimation[0]]
    experiments = campaign.realizations * campaign.block_size(len(run.loaded.robot.joints))
    guess = np.mean([row["information"] for row in by_model[study.guess]], axis=0)
    return Found(
        study=study,
        models=models,
        springs=tuple(reference[0]["springs"].tolist()),
        truth=np.array([row["true_stiffness"] for row in reference]),
        there=np.isfinite([row["measured_hz"] for row in reference]),
        design=design,
        effort=effort_curves(design, guess, models[study.guess].wanted, experiments),
        steps=tuple(read_steps(result) for result in earlier[2]),
        first={name: rows[0] for name, rows in by_model.items()},
    )


def _values(result: Artifact) -> dict[str, Any]:
    return values_of(result)


def _further_sets(run: Run, study: ZimmermannStudy, earlier: Earlier) -> dict[str, list[list[dict[str, Any]]]]:
    """Results of each further set of drawn models, by model and individual."""
    results = [_values(result) for result in earlier[3]]
    found: dict[str, list[list[dict[str, Any]]]] = {}
    for pair in pairs(run, earlier):
        owners = owners_of_sets(study, len(pair.configurations))
        own, results = results[: len(owners)], results[len(owners) :]
        for name in dict.fromkeys(owners):
            each = [row for owner, row in zip(owners, own, strict=True) if owner == name]
            found.setdefault(name, []).append(each)
    return found


def _errors(row: dict[str, Any], key: str) -> FloatArray:
    """Logarithm of each estimated spring over its true linear stiffness (n_wanted,)."""
    estimated = {name for name in row["names"].tolist() if name.endswith(".stiffness")}
    chosen = [f"{spring}.stiffness" in estimated for spring in row["springs"].tolist()]
    return np.asarray(np.log(row[key] / row["true_stiffness"])[chosen])


def _model(name: str, rows: list[dict[str, Any]], further: list[list[dict[str, Any]]]) -> Model:
    wanted = tuple(rows[0]["wanted"].tolist())
    more = further or [[] for _ in rows]
    places = [rows[0]["names"].tolist().index(spring) for spring in wanted]

    def errors(key: str) -> FloatArray:
        return np.array([[_errors(each, key) for each in (row, *sets)] for row, sets in zip(rows, more, strict=True)])

    return Model(
        name=name,
        used=tuple(rows[0]["used"].tolist()),
        wanted=wanted,
        std=np.array([row["std"] for row in rows]),
        fit_std=np.array([row["fit_std"][places] for row in rows]),
        effective_std=np.array([row["effective_std"][places] for row in rows]),
        error=errors("physical_stiffness"),
        fit_error=errors("stiffness"),
        stiffness=np.array([row["stiffness"] for row in rows]),
        cost=np.array([row["cost"] for row in rows]),
        expected=np.array([row["expected"] for row in rows]),
        resonance_error=np.array([row["model_hz"] / row["measured_hz"] - 1 for row in rows]),
        slope=np.array([row["slope"] for row in rows]) if "slope" in rows[0] else None,
    )


def summarise(found: Found) -> dict[str, float]:
    """All figures by name: medians over the individuals."""
    study, models = found.study, found.models
    summary: dict[str, float] = {}
    for name, one in models.items():
        for key, values in (
            ("average_std", one.average_std),
            ("worst_std", one.std.max(axis=1)),
            *((f"{mean}_fit_std", one.stated(mean)) for mean in get_args(Mean)),
            *((f"{mean}_effective_std", over_springs(one.effective_std, mean)) for mean in get_args(Mean)),
            ("average_cost", one.average_cost),
            ("worst_cost", one.cost.max(axis=1)),
            ("average_excess", one.average_excess),
        ):
            summary[f"{name}.{key}"] = float(np.median(values))
            summary[f"{name}.{key}_low"], summary[f"{name}.{key}_high"] = float(values.min()), float(values.max())
        if len(one.error) > 1:
            summary[f"{name}.scatter"] = scatter(one.error, "average")
            summary[f"{name}.fit_scatter"] = scatter(one.fit_error, "average")
            summary[f"{name}.typical_scatter"] = scatter(one.error, "typical")
            summary[f"{name}.typical_fit_scatter"] = scatter(one.fit_error, "typical")
            summary[f"{name}.offset"] = float(np.abs(one.error.mean(axis=(0, 1))).mean())
        if len(one.error) > 2:
            summary[f"{name}.scatter_error"] = scatter_error(one.error, "average")
        summary[f"{name}.missed"] = float(np.median((one.missed & found.there).sum(axis=(1, 2))))
    optimal, reference = models[study.optimal], models[study.reference]
    summary[f"{study.optimal}.gap"] = found.design.gap
    summary[f"{study.optimal}.over_{study.reference}_cost"] = _ratio(optimal.average_cost, reference.average_cost)
    summary["resonances"] = float(np.median(found.there.sum(axis=(1, 2))))
    summary |= {f"effort.{name}": value for name, value in found.effort.figures.items()}
    if study.nonlinear is not None:
        other = models[study.nonlinear]
        summary[f"{study.nonlinear}.excess_ratio"] = _ratio(other.average_excess, reference.average_excess)
        explained = explained_springs(found)
        if explained:
            off = [abs(np.median(local / slope) - 1) for local, slope in explained.values()]
            summary[f"{study.nonlinear}.explains_error"] = float(np.median(off))
    return summary | _step_summary(found.steps)


def explained_springs(found: Found) -> dict[tuple[str, str], tuple[FloatArray, FloatArray]]:
    """Springs of bent gears in every linear model, and the nonlinear model's mean slope in its configurations.

    Returns:
        Both (n_seed,) by model and spring [N m/rad]; empty without a nonlinear model.
    """
    study = found.study
    slopes = None if study.nonlinear is None else found.models[study.nonlinear].slope
    if slopes is None:
        return {}
    spread = (np.ptp(slopes, axis=1) / slopes.mean(axis=1)).max(axis=0)
    bent = np.flatnonzero(spread > _BENT).tolist()
    return {
        (name, found.springs[index]): (one.stiffness[:, index], slopes[:, list(one.used), index].mean(axis=1))
        for name, one in found.models.items()
        if one.slope is None
        for index in bent
    }


def _ratio(one: FloatArray, other: FloatArray) -> float:
    return float(np.median(one / other))


def _step_summary(steps: tuple[StepResponses, ...]) -> dict[str, float]:
    every = [step_figures(one) for one in steps]
    found: Mapping[str, float] = {}
    for name in every[0] if every else ():
        for key in ("tool_rms_m", "torque_rms_nm", "path_rms_m", "vibration_m", "tool_relative"):
            values = [getattr(one[name], key) for one in every]
            found = {**found, f"{name.replace(' ', '_')}.step_{key}": float(np.median(values))}
    return dict(found)


@dataclass(frozen=True)
class Rivals:
    """Models with as few configurations as the optimal one."""

    lower: tuple[str, ...]  # Those that are surely below it
    tied: tuple[str, ...]  # Those that differ from it by no more than chance over the individuals


def rivals(found: Found, mean: Mean) -> dict[str, Rivals]:
    """Returns the optimal model's rivals by `deviation`, as fits state it, and by `scatter` about the truth.

    Args:
        found: What the study found.
        mean: Mean over the springs.
    """
    own = found.models[found.study.optimal]
    others = [found.models[name] for name in found.small if name != found.study.optimal]
    stated, scattered = {}, {}
    for one in others:
        pair = one.stated(mean), own.stated(mean)
        stated[one.name] = float(np.median(pair[0] / pair[1])), differs(*pair)
        ratio = scatter(one.error, mean) / scatter(own.error, mean)
        scattered[one.name] = ratio, scatters_differ(one.error, own.error, mean)
    return {"deviation": _rivals(stated), "scatter": _rivals(scattered)}


def _rivals(ratios: Mapping[str, tuple[float, bool]]) -> Rivals:
    """By each model's figure over the optimal one's, and whether that is more than chance."""
    lower = tuple(name for name, (ratio, surely) in ratios.items() if surely and ratio < 1)
    return Rivals(lower, tuple(name for name, (_, surely) in ratios.items() if not surely))
