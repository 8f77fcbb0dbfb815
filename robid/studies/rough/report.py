"""What the study of rough robot files found: shares of right grades, bounds that hold, and what the cut-off loses."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.artifacts.artifact import Artifact
from robid.pipeline.graph import Run
from robid.report.numbers import percent, significant
from robid.report.section import Beside, Figure, Section
from robid.results.grade import DO_NOT_USE
from robid.studies.page import CHOOSING, Asked, Conclusion, PartFound, by_name, concluded, curves, table
from robid.studies.rough.cutoffs import recordings
from robid.studies.rough.individuals import BAD, FITS, GOOD, populations, worst_errors
from robid.studies.settings.rough import RoughStudy
from robid.studies.study import Earlier, Results, study_of, values_of

ASKED = {
    "rough.refused": Asked(upper=0.05, what="share of good validated fits that are not to be used"),
    "rough.expected_error": Asked(0.9, 0.99, "share of motors of one-motion fits whose error is within its 95 % bound"),
    "rough.expected_width": Asked(upper=2.5, what="that bound over the error, median"),
    "rough.let_through": Asked(upper=1, what="bad one-motion fits that may be used"),
    "rough.one_motion_refused": Asked(upper=0.25, what="share of good one-motion fits that are not to be used"),
}
_LOSS = Asked(upper=1.2, what="held-out error of the automatic cut-off over that of the best constant one, at worst")


@dataclass(frozen=True)
class Fits:
    """The fits of one kind, one for each robot."""

    arm: tuple[str, ...]  # Kind of each robot
    seed: tuple[str, ...]  # Its seed
    worst: FloatArray  # (n_robot,) largest true error of a motor; NaN where the data were refused
    refused: BoolArray  # (n_robot,) whether it is not to be used
    error: FloatArray  # (n_motor,) true errors of the motors of all robots
    bound: FloatArray  # (n_motor,) their bounds as stated; NaN where none is
    cut_hz: FloatArray  # (n_robot,) cut-offs [Hz]
    sentence: tuple[str, ...]  # What was said of each

    @property
    def good(self) -> BoolArray:
        """Which are good (n_robot,)."""
        return np.asarray(self.worst <= GOOD)

    @property
    def bad(self) -> BoolArray:
        """Which are bad (n_robot,)."""
        return np.asarray(self.worst > BAD)


def read_fits(results: Iterable[Artifact]) -> dict[str, Fits]:
    """Reads the fits of all robots, by kind of fit."""
    held = list(results)
    rows = [values_of(one) for one in held]

    def of(at: int) -> Fits:
        error, bound = (np.concatenate([row[key][at] for row in rows]) for key in ("error", "bound"))
        return Fits(
            arm=tuple(str(one.attributes["arm"]) for one in held),
            seed=tuple(str(one.attributes["seed"]) for one in held),
            worst=np.array([worst_errors(row["error"])[at] for row in rows]),
            refused=np.array([row["grade"][at] == DO_NOT_USE for row in rows]),
            error=error,
            bound=bound,
            cut_hz=np.array([row["cut"][at] for row in rows]),
            sentence=tuple(str(row["sentence"][at]) for row in rows),
        )

    return {name: of(at) for at, name in enumerate(FITS)}


def grade_figures(fits: Mapping[str, Fits]) -> dict[str, float]:
    """Returns how often grades and bounds are right; what is not known is left out."""
    validated, alone = (fits[name] for name in FITS)
    known = np.isfinite(alone.bound) & np.isfinite(alone.error)
    within = alone.error[known] <= alone.bound[known]
    found = {
        "rough.refused": _share(validated.refused, validated.good),
        "rough.refused_fits": float(np.sum(validated.refused & validated.good)),
        "rough.expected_error": float(within.mean()) if known.any() else np.nan,
        "rough.expected_width": float(np.median(alone.bound[known] / alone.error[known])) if known.any() else np.nan,
        "rough.let_through": float(np.sum(~alone.refused & alone.bad)),
        "rough.one_motion_refused": _share(alone.refused, alone.good),
        "rough.validated.let_through": float(np.sum(~validated.refused & validated.bad)),
        "rough.robots": float(len(validated.worst)),
    }
    for name, own in fits.items():
        found[f"rough.{name}.unfitted"] = float(np.sum(np.isnan(own.worst)))
        found[f"rough.{name}.median_error"] = float(np.nanmedian(own.worst))
    return {name: value for name, value in found.items() if np.isfinite(value)}


def _share(of: BoolArray, among: BoolArray) -> float:
    return float(of[among].mean()) if among.any() else np.nan


def cut_off_figures(results: Results) -> dict[str, float]:
    """Returns what the automatic cut-off loses, by data and at worst, with its parameters beside the best one's."""
    found, losses = dict[str, float](), []
    for name, held in zip(results.by_name, results, strict=True):
        values = values_of(held)
        error = values["error"].mean(axis=1)
        best = 1 + int(np.argmin(error[1:]))
        losses.append(float(error[0] / error[best]))
        chosen = {"loss": losses[-1], "automatic_hz": values["cut"][0].mean(), "best_hz": values["cut"][best].mean()}
        parameters = values["parameters"].mean(axis=1)
        chosen |= {"parameters": parameters[0], "best_parameters": parameters[best], "error": error[0]}
        found |= {f"cutoff.{name}.{key}": float(value) for key, value in chosen.items() if np.isfinite(value)}
    # A fit that is refused has lost everything: the worst stays infinite.
    return found | ({"cutoff.loss": max(losses)} if losses else {})


def conclude(run: Run, results: Earlier) -> Conclusion:
    """Turns fits and cut-offs into figures, tables and the verdict."""
    study, (*rounds, cutoffs) = study_of(run.loaded, RoughStudy), results
    held = [one for each in rounds for one in each]
    fits, counts = read_fits(held), populations(held)
    figures = {**grade_figures(fits), **{f"rough.{name}": count for name, count in counts.items()}}
    wanted = {"good": study.good, "bad": study.bad}
    asked = {f"rough.{name}.{which}": Asked(lower=least) for name in FITS for which, least in wanted.items()}
    flatter = () if study.use == "judge" else (CHOOSING,)
    sections = (_populations(fits), _wrong(fits), _bounds(fits["one_motion"]))
    grades = PartFound(figures, {**ASKED, **asked}, sections, flatter)
    lost = cut_off_figures(cutoffs)
    part = PartFound(lost, {"cutoff.loss": _LOSS} if lost else {}, _cut_offs(cutoffs, lost), recordings(run)[1])
    return concluded([grades, part], "grades of rigid fits hold where robot files are rough")


_TITLES = {"validated": "Several motions, validated on another", "one_motion": "One motion, validated on none"}


def _populations(fits: Mapping[str, Fits]) -> Section:
    rows = [(name, arm) for name, own in fits.items() for arm in dict.fromkeys(own.arm)]

    def count(row: tuple[str, str], of: BoolArray) -> str:
        return str(int(np.sum(of & (np.array(fits[row[0]].arm) == row[1]))))

    columns = (
        ("Fits", lambda row: _TITLES[row[0]]),
        ("Arms", lambda row: row[1]),
        ("Robots", lambda row: count(row, np.ones(len(fits[row[0]].arm), bool))),
        ("Good", lambda row: count(row, fits[row[0]].good)),
        ("of these do not use", lambda row: count(row, fits[row[0]].good & fits[row[0]].refused)),
        ("Bad", lambda row: count(row, fits[row[0]].bad)),
        ("of these not", lambda row: count(row, fits[row[0]].bad & ~fits[row[0]].refused)),
        ("Without a fit", lambda row: count(row, np.isnan(fits[row[0]].worst))),
    )
    lead = (
        f"Of a good fit all motors are within {percent(GOOD)} on motions that no fit saw, of a bad one a motor is"
        f" beyond {percent(BAD)}: root mean square of its torque's error over that of its torque, or over a tenth of"
        " its rated torque where that is more, in one band fixed beforehand."
    )
    return Section("Fits of robots whose files are rough", lead, (table(columns, rows, fit="compact"),))


def _wrong(fits: Mapping[str, Fits]) -> Section:
    wrong = [
        (name, at)
        for name, own in fits.items()
        for at in np.flatnonzero((own.good & own.refused) | (own.bad & ~own.refused)).tolist()
    ]
    columns = (
        ("Robot", lambda row: f"{fits[row[0]].arm[row[1]]} {fits[row[0]].seed[row[1]]}"),
        ("Fit", lambda row: _TITLES[row[0]]),
        ("Worst motor", lambda row: percent(float(fits[row[0]].worst[row[1]]))),
        ("Cut-off [Hz]", lambda row: significant(float(fits[row[0]].cut_hz[row[1]]))),
        ("What is said", lambda row: fits[row[0]].sentence[row[1]]),
    )
    lead = "Good fits that are not to be used, and bad ones that may be."
    return Section("Grades that are wrong", lead, (table(columns, wrong, fit="tall", prose=True),))


def _bounds(alone: Fits) -> Section:
    known = np.isfinite(alone.bound) & np.isfinite(alone.error)
    if not known.any():
        return Section("Errors that fits expect", "The fits state no bound of their error on other motions.", ())
    error, bound = alone.error[known], alone.bound[known]
    order = np.argsort(error)
    shown = curves(error[order], {"Bound": bound[order]}, points=True) + curves(error[order], {"Error": error[order]})
    titles = ("True error of a motor on new motions", "Error, and the bound that its fit states")
    return Section("Errors that fits expect", "Motors of all fits of one motion.", (Figure("", *titles, shown),))


def _cut_offs(results: Results, figures: Mapping[str, float]) -> tuple[Section, ...]:
    if not len(results):
        return ()
    columns = (
        ("Data", lambda name: name.removeprefix("cutoff.")),
        by_name(figures, "Automatic [Hz]", "automatic_hz"),
        by_name(figures, "Best [Hz]", "best_hz"),
        by_name(figures, "Error", "error"),
        by_name(figures, "over that of the best", "loss"),
        by_name(figures, "Parameters off", "parameters", percent),
        by_name(figures, "at the best", "best_parameters", percent),
    )
    lead = (
        "Half of the data is fitted, the other half held out, both ways; errors of all motors, root mean square, in"
        " one band fixed beforehand. Parameters are off by the median over the base parameters."
    )
    shown = []
    for name, held in zip(results.by_name, results, strict=True):
        values = values_of(held)
        constant = {"Constant": values["error"][1:].mean(axis=1)}
        chosen = curves(values["cut"][0], {"Automatic": values["error"][0]}, points=True)
        lines = curves(values["cut"][1:].mean(axis=1), constant) + chosen
        shown.append(Figure(name, "Cut-off [Hz]", "Held-out error", lines, height=260))
    made = table(columns, [f"cutoff.{name}" for name in results.by_name], fit="compact")
    return (Section("The automatic cut-off against constant ones", lead, (made, Beside(tuple(shown), columns=3))),)
