"""The figures of the study of configurations: models against each other, and how long one must measure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, get_args

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.artifacts.kinds import DESIGN, design_from_artifact, from_datasets
from robid.artifacts.store import read_artifact
from robid.design.configurations.exchange import Exchange, Information
from robid.design.configurations.information import ConfigurationDesign
from robid.design.configurations.visits import Visits, make_visits
from robid.pipeline.graph import Run
from robid.studies.settings.study import ZimmermannStudy
from robid.studies.simulated import Mean, differs, over_springs, scatter, scatter_error, scatters_differ
from robid.studies.study import Earlier, study_of, values_of
from robid.studies.zimmermann2023.models import owners_of_sets, pairs
from robid.studies.zimmermann2023.steps import StepResponses, step_figures

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
    """Predicts deviations over the number of experiments, of which each visit has some.

    The configurations that an engineer chose have information (n_guess, n_param, n_param) per visit about named
    parameters; what the design allows them to differ by holds here too.
    """
    generator, candidates = np.random.default_rng(_SEED), design.visits
    between = dict(zip(design.parameter_names, candidates.between.tolist(), strict=True))
    guessed = make_visits(guess[None, :, None], np.array([between.get(name, 0.0) for name in names]))
    rows = []
    for visits in _VISITS.tolist():
        drawn = deviations(np.array([_random(candidates, visits, generator) for _ in range(_DRAWS)]))
        known = deviations(_optimal(candidates, visits)), deviations(_in_turn(guessed, visits))
        rows.append([*known, np.median(drawn, axis=0), np.quantile(drawn, 0.9, axis=0)])
    experiments = _VISITS * float(per_visit)
    average, worst = (
        dict(zip(("optimal", "guess", "random", "worst of random"), values, strict=True))
        for values in np.array(rows).transpose(2, 1, 0)
    )
    goal, own = float(deviations(_in_turn(guessed, len(guess)))[0]), float(len(guess) * per_visit)
    needed = {name: crossing(experiments, average[name], goal) for name in ("optimal", "random")}
    told = {name: f"{many:.0f}" if np.isfinite(many) else "more than were looked at" for name, many in needed.items()}
    sentence = (
        f"An average deviation of {100 * goal:.2g} %, which the guess reaches with {own:.0f} experiments,"
        f" takes {told['optimal']} in optimal configurations and {told['random']} in random ones (median)."
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


def _optimal(candidates: Visits, visits: int) -> FloatArray:
    """As many visits as tell most, shared out by exchange; few do not determine everything."""
    count, size = candidates.alone.shape[1], candidates.alone.shape[-1]
    base = _FLOOR * candidates.once.sum(axis=1)
    objective = Information("d", candidates, base, size)
    problem = Exchange(objective, visits, visits, True, np.ones(count), float(visits))
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


MISSED = 0.03  # Relative error from which a first resonance counts as missed
_BENT = 0.01  # Spread of a spring's slope over the configurations from which gravity counts as bending it


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
    revisited_cost: FloatArray | None = None  # (n_first,) mean cost in configurations that were fitted, of the first

    def stated(self, mean: Mean) -> FloatArray:
        """Mean over the springs of the deviation that the fit states (n_seed,)."""
        return over_springs(self.fit_std, mean)

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
    study = study_of(run.loaded, ZimmermannStudy)
    results = [values_of(result) for result in earlier[1]]
    by_model = {name: results[index :: len(study.models)] for index, name in enumerate(study.models)}
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
        steps=tuple(from_datasets(StepResponses, result) for result in earlier[2]),
        first={name: rows[0] for name, rows in by_model.items()},
    )


def _further_sets(run: Run, study: ZimmermannStudy, earlier: Earlier) -> dict[str, list[list[dict[str, Any]]]]:
    results = iter(earlier[3])
    found: dict[str, list[list[dict[str, Any]]]] = {}
    for pair in pairs(run, earlier):
        own: dict[str, list[dict[str, Any]]] = {}
        for name in owners_of_sets(study, len(pair.configurations)):
            own.setdefault(name, []).append(values_of(next(results)))
        for name, each in own.items():
            found.setdefault(name, []).append(each)
    return found


def _model(name: str, rows: list[dict[str, Any]], further: list[list[dict[str, Any]]]) -> Model:
    wanted = tuple(rows[0]["wanted"].tolist())
    more = further or [[] for _ in rows]
    again = [float(row["revisited_cost"].mean()) for row in rows if "revisited_cost" in row]
    places = [rows[0]["names"].tolist().index(spring) for spring in wanted]

    def every(key: str) -> FloatArray:
        return np.array([row[key] for row in rows])

    def error(row: dict[str, Any], key: str) -> FloatArray:
        """Logarithm of each estimated spring over its true linear stiffness (n_wanted,)."""
        estimated = {name for name in row["names"].tolist() if name.endswith(".stiffness")}
        chosen = [f"{spring}.stiffness" in estimated for spring in row["springs"].tolist()]
        return np.asarray(np.log(row[key] / row["true_stiffness"])[chosen])

    def errors(key: str) -> FloatArray:
        return np.array([[error(each, key) for each in (row, *sets)] for row, sets in zip(rows, more, strict=True)])

    return Model(
        name=name,
        used=tuple(rows[0]["used"].tolist()),
        wanted=wanted,
        **{key: every(key) for key in ("std", "stiffness", "cost", "expected")},
        **{key: every(key)[:, places] for key in ("fit_std", "effective_std")},
        **{"error": errors("physical_stiffness"), "fit_error": errors("stiffness")},
        resonance_error=every("model_hz") / every("measured_hz") - 1,
        slope=every("slope") if "slope" in rows[0] else None,
        revisited_cost=np.array(again) if again else None,
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
    over = optimal.cost.mean(axis=1) / reference.cost.mean(axis=1)
    summary[f"{study.optimal}.over_{study.reference}_cost"] = float(np.median(over))
    summary["resonances"] = float(np.median(found.there.sum(axis=(1, 2))))
    summary |= {f"effort.{name}": value for name, value in found.effort.figures.items()}
    again = reference.revisited_cost
    if again is not None:
        summary[f"{study.reference}.revisited_cost"] = float(np.median(again))
    summary |= prediction_figures(found)
    if study.nonlinear is not None:
        left = models[study.nonlinear].average_excess / reference.average_excess
        summary[f"{study.nonlinear}.excess_ratio"] = float(np.median(left))
        if explained := explained_springs(found):
            off = [abs(np.median(local / slope) - 1) for local, slope in explained.values()]
            summary[f"{study.nonlinear}.explains_error"] = float(np.median(off))
    steps = [step_figures(one) for one in found.steps]
    for name in steps[0] if steps else ():
        for key in ("tool_rms_m", "torque_rms_nm", "path_rms_m", "vibration_m", "tool_relative"):
            summary[f"{name.replace(' ', '_')}.step_{key}"] = float(np.median([one[name][key] for one in steps]))
    return summary


def random_models(found: Found) -> list[Model]:
    """Models of as many configurations as the predictive one, drawn at random."""
    size = 0 if found.study.predictive is None else len(found.models[found.study.predictive].used)
    choices = found.study.models
    drawn = (name for name, one in choices.items() if one.count is not None and one.low_torque is None)
    return [found.models[name] for name in drawn if len(found.models[name].used) == size]


def prediction_figures(found: Found) -> dict[str, float]:
    """The predictive model against random sets, the mean over the individuals, and against the optimal model."""
    random, name = random_models(found), found.study.predictive
    if name is None or not random:
        return {}
    own, optimal = found.models[name], found.models[found.study.optimal]
    drawn = np.mean([one.cost.mean(axis=1) for one in random], axis=0)
    cost, whole = own.cost.mean(axis=1), float(drawn.mean())
    # Paired: the same individuals and configurations, one difference each.
    error = float(np.std(cost - drawn, ddof=1) / np.sqrt(cost.size)) if cost.size > 1 else np.nan
    figures = {
        "vs_random": float(cost.mean()) / whole,
        "vs_random_error": error / whole,
        f"vs_{optimal.name}": float(cost.mean() / optimal.cost.mean()),
    }
    # One by one too, so that studies of some individuals each can be put together.
    by_name = {"cost": cost, "random_cost": drawn, f"{optimal.name}_cost": optimal.cost.mean(axis=1)}
    for key, values in by_name.items():
        figures |= {f"{key}.{each}": float(v) for each, v in zip(found.study.estimation, values, strict=True)}
    if len(own.error) > 1:
        scatters = [scatter(each.error, "average") for each in (own, optimal, *random)]
        figures[f"scatter_vs_{optimal.name}"] = scatters[0] / scatters[1]
        figures["random_scatter_vs_own"] = float(np.mean(scatters[2:])) / scatters[0]
    return {f"{name}.{key}": value for key, value in figures.items()}


def _model_figures(one: Model) -> dict[str, float]:
    summary: dict[str, float] = {}
    for key, values in (
        ("average_std", one.std.mean(axis=1)),
        ("worst_std", one.std.max(axis=1)),
        *((f"{mean}_fit_std", one.stated(mean)) for mean in get_args(Mean)),
        *((f"{mean}_effective_std", over_springs(one.effective_std, mean)) for mean in get_args(Mean)),
        ("average_cost", one.cost.mean(axis=1)),
        ("worst_cost", one.cost.max(axis=1)),
        ("average_excess", one.average_excess),
    ):
        summary[key] = float(np.median(values))
        summary[f"{key}_low"], summary[f"{key}_high"] = float(values.min()), float(values.max())
    if len(one.error) > 1:
        for mean in get_args(Mean):
            prefix = "" if mean == "average" else f"{mean}_"
            summary[f"{prefix}scatter"] = scatter(one.error, mean)
            summary[f"{prefix}fit_scatter"] = scatter(one.fit_error, mean)
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


@dataclass(frozen=True)
class Rivals:
    """Models with as few configurations as the optimal one."""

    lower: tuple[str, ...]  # Those that are surely below it
    tied: tuple[str, ...]  # Those that differ from it by no more than chance over the individuals


def rivals(found: Found, mean: Mean) -> dict[str, Rivals]:
    """Returns the optimal model's rivals by `deviation`, as fits state it, and by `scatter` about the truth."""
    own = found.models[found.study.optimal]
    # By each model its figure over the optimal one's, and whether that is more than chance.
    ratios: dict[str, dict[str, tuple[float, bool]]] = {"deviation": {}, "scatter": {}}
    for name in found.small:
        if name != found.study.optimal:
            one = found.models[name]
            pair = one.stated(mean), own.stated(mean)
            ratios["deviation"][name] = float(np.median(pair[0] / pair[1])), differs(*pair)
            ratio = scatter(one.error, mean) / scatter(own.error, mean)
            ratios["scatter"][name] = ratio, scatters_differ(one.error, own.error, mean)
    return {
        key: Rivals(
            tuple(name for name, (ratio, surely) in each.items() if surely and ratio < 1),
            tuple(name for name, (_, surely) in each.items() if not surely),
        )
        for key, each in ratios.items()
    }
