"""The figures of the study of configurations: models against each other, and how long one must measure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.artifacts.kinds import DESIGN, design_from_artifact
from robid.artifacts.store import read_artifact
from robid.design.configurations.information import ConfigurationDesign
from robid.design.configurations.plan import Exchange
from robid.design.configurations.visits import Visits, make_visits
from robid.pipeline.graph import Run
from robid.studies.settings.elastic import ZimmermannStudy
from robid.studies.simulated import Mean, differs, over_springs, scatter, scatter_error, scatters_differ
from robid.studies.study import Earlier, study_of, values_of
from robid.studies.zimmermann2023.models import owners_of_sets, pairs
from robid.studies.zimmermann2023.steps import StepResponses, read_steps, step_figures

_VISITS = np.array([1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 17, 21, 28, 35, 42, 49])
_DRAWS = 200
_SEED = 1
_SINGULAR = 1e12
_FLOOR = 1e-9


@dataclass(frozen=True)
class EffortCurves:
    """Deviations of the springs over the number of experiments."""

    experiments: FloatArray  # (n_count,) numbers of experiments
    # Mean relative deviation (n_count,) by choice; infinite where the experiments do not suffice
    average: dict[str, FloatArray]
    worst: dict[str, FloatArray]  # Largest one
    sentence: str  # What follows for who measures
    # Numbers of experiments by choice that reach what the guess reaches with a visit of each
    figures: dict[str, float]


def effort_curves(
    design: ConfigurationDesign, guess: FloatArray, names: tuple[str, ...], per_visit: int
) -> EffortCurves:
    """Predicts deviations over the number of experiments.

    Args:
        design: The design with its candidates' information per visit.
        guess (n_guess, n_param, n_param): Information of the configurations that an engineer chose, per visit.
        names: Names of the guess' parameters; what the design allows them to differ by holds here too.
        per_visit: Experiments of a visit.
    """
    found: dict[str, list[FloatArray]] = {"optimal": [], "guess": [], "random": [], "worst of random": []}
    generator = np.random.default_rng(_SEED)
    candidates = design.visits
    between = dict(zip(design.parameter_names, candidates.between.tolist(), strict=True))
    guessed = make_visits(guess[None, :, None], np.array([between.get(name, 0.0) for name in names]))
    for visits in _VISITS.tolist():
        found["optimal"].append(deviations(_optimal(candidates, visits)))
        found["guess"].append(deviations(_in_turn(guessed, visits)))
        drawn = deviations(np.array([_random(candidates, visits, generator) for _ in range(_DRAWS)]))
        found["random"].append(np.median(drawn, axis=0))
        found["worst of random"].append(np.quantile(drawn, 0.9, axis=0))
    experiments = _VISITS * float(per_visit)
    average = {name: np.array(rows)[:, 0] for name, rows in found.items()}
    worst = {name: np.array(rows)[:, 1] for name, rows in found.items()}
    goal = float(deviations(_in_turn(guessed, len(guess)))[0])
    needed = {name: crossing(experiments, average[name], goal) for name in ("optimal", "random")}
    own = float(len(guess) * per_visit)
    sentence = (
        f"An average deviation of {100 * goal:.2g} %, which the guess reaches with {own:.0f} experiments,"
        f" takes {_count(needed['optimal'])} in optimal configurations and {_count(needed['random'])} in random ones"
        " (median)."
    )
    figures = {f"{name}_experiments": count for name, count in needed.items() if np.isfinite(count)}
    return EffortCurves(experiments, average, worst, sentence, {**figures, "guess_experiments": own})


def deviations(information: FloatArray) -> FloatArray:
    """Mean and largest deviation of log-parameters with some information (..., n_param, n_param).

    Returns:
        Both (..., 2); infinite where the information is singular.
    """
    scale = np.sqrt(np.maximum(np.diagonal(information, axis1=-2, axis2=-1), np.finfo(float).tiny))
    scaled = information / (scale[..., :, None] * scale[..., None, :])
    singular = np.linalg.cond(scaled) > _SINGULAR
    inverse = np.linalg.inv(np.where(singular[..., None, None], np.eye(scale.shape[-1]), scaled))
    std = np.sqrt(np.diagonal(inverse, axis1=-2, axis2=-1)) / scale
    both = np.stack([std.mean(axis=-1), std.max(axis=-1)], axis=-1)
    return np.asarray(np.where(singular[..., None], np.inf, both))


def crossing(experiments: FloatArray, values: FloatArray, goal: float) -> float:
    """Number of experiments at which a curve first falls to a goal, logarithms interpolated; infinite if never."""
    below = np.flatnonzero(values <= goal)
    if below.size == 0:
        return float(np.inf)
    at = int(below[0])
    if at == 0 or not np.isfinite(values[at - 1]):
        return float(experiments[at])
    x, y = np.log(experiments[at - 1 : at + 1]), np.log(values[at - 1 : at + 1])
    return float(np.exp(x[0] + (np.log(goal) - y[0]) * (x[1] - x[0]) / (y[1] - y[0])))


def _count(needed: float) -> str:
    return f"{needed:.0f}" if np.isfinite(needed) else "more than were looked at"


def _optimal(candidates: Visits, visits: int) -> FloatArray:
    """As many visits as tell most, shared out by exchange; few do not determine everything."""
    count, size = candidates.alone.shape[1], candidates.alone.shape[-1]
    base = _FLOOR * candidates.once.sum(axis=1)
    problem = Exchange("d", candidates, base, visits, visits, True, np.ones(count), float(visits), size)
    return _told(candidates, problem.improved(problem.greedy(np.zeros(count, int))))


def _in_turn(guess: Visits, visits: int) -> FloatArray:
    count = guess.alone.shape[1]
    return _told(guess, np.full(count, visits // count) + (np.arange(count) < visits % count))


def _random(candidates: Visits, visits: int, generator: np.random.Generator) -> FloatArray:
    count = candidates.alone.shape[1]
    drawn = generator.choice(count, visits, replace=visits > count)
    return _told(candidates, np.bincount(drawn, minlength=count))


def _told(candidates: Visits, counts: IntArray) -> FloatArray:
    return np.asarray(candidates.total(counts)[0, 0])


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
    results = [values_of(result) for result in earlier[1]]
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


def _further_sets(run: Run, study: ZimmermannStudy, earlier: Earlier) -> dict[str, list[list[dict[str, Any]]]]:
    """Results of each further set of drawn models, by model and individual."""
    results = [values_of(result) for result in earlier[3]]
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
        summary |= {f"{name}.{key}": value for key, value in _model_figures(one).items()}
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
    steps = [step_figures(one) for one in found.steps]
    for name in steps[0] if steps else ():
        for key in ("tool_rms_m", "torque_rms_nm", "path_rms_m", "vibration_m", "tool_relative"):
            values = [getattr(one[name], key) for one in steps]
            summary[f"{name.replace(' ', '_')}.step_{key}"] = float(np.median(values))
    return summary


def _model_figures(one: Model) -> dict[str, float]:
    """Medians over the individuals with the ends of their range, and the scatter where there are several."""
    summary: dict[str, float] = {}
    for key, values in (
        ("average_std", one.average_std),
        ("worst_std", one.std.max(axis=1)),
        *((f"{mean}_fit_std", one.stated(mean)) for mean in get_args(Mean)),
        *((f"{mean}_effective_std", over_springs(one.effective_std, mean)) for mean in get_args(Mean)),
        ("average_cost", one.average_cost),
        ("worst_cost", one.cost.max(axis=1)),
        ("average_excess", one.average_excess),
    ):
        summary[key] = float(np.median(values))
        summary[f"{key}_low"], summary[f"{key}_high"] = float(values.min()), float(values.max())
    if len(one.error) > 1:
        summary["scatter"], summary["fit_scatter"] = (scatter(each, "average") for each in (one.error, one.fit_error))
        summary["typical_scatter"] = scatter(one.error, "typical")
        summary["typical_fit_scatter"] = scatter(one.fit_error, "typical")
        summary["offset"] = float(np.abs(one.error.mean(axis=(0, 1))).mean())
    if len(one.error) > 2:
        summary["scatter_error"] = scatter_error(one.error, "average")
    return summary


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


@dataclass(frozen=True)
class Rivals:
    """Models with as few configurations as the optimal one."""

    lower: tuple[str, ...]  # Those that are surely below it
    tied: tuple[str, ...]  # Those that differ from it by no more than chance over the individuals


def rivals(found: Found, mean: Mean) -> dict[str, Rivals]:
    """Returns the optimal model's rivals by `deviation`, as fits state it, and by `scatter` about the truth."""
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
