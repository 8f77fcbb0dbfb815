"""What the study of estimators found: tables, figures, and which default follows."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robid.arrays import FloatArray
from robid.pipeline.graph import Run
from robid.report.numbers import MISSING, percent, significant
from robid.report.page import Verdict
from robid.report.section import Curve, Figure, Section, Table
from robid.settings.experiment import Campaign
from robid.studies.frf.figures import (
    BiasFigures,
    EstimatorFigures,
    bias_figures,
    estimator_figures,
    gather,
    true_response,
)
from robid.studies.frf.study import campaign_of, compared, compensations
from robid.studies.study import Conclusion, Earlier

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
    return Conclusion(
        verdict=Verdict(f"{default_sentence(estimators, own.estimator)} {bias_sentence(biases)}", "ok"),
        summary={name: value for name, value in summary.items() if math.isfinite(value)},
        sections=(
            _estimator_section(estimators, frequency, campaign, study.group),
            _bias_section(biases, frequency, study.group, campaign.realizations),
        ),
        warnings=tuple(f"{name} refused: {reason}." for name, reason in refusals if reason),
    )


def following_default(estimators: Sequence[EstimatorFigures], default: str) -> str:
    """Returns the estimator that follows as the default: another one only where it is surely and markedly closer."""
    closer = [one for one in estimators if one.figures["over_default_upper"] < _WORTH]
    return min(closer, key=lambda one: one.figures["over_default"]).name if closer else default


def default_sentence(estimators: Sequence[EstimatorFigures], default: str) -> str:
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


def bias_sentence(biases: Sequence[BiasFigures]) -> str:
    """Says what each compensation leaves of the bias."""
    left = [f"{percent(one.figures['median_diagonal'])} with compensation {one.name}" for one in biases]
    return f"Median bias on the diagonal: {', '.join(left)}."


def _count(value: float) -> str:
    return f"{value:.0f}"


def _share(one: EstimatorFigures) -> str:
    figures = one.figures
    if not math.isfinite(figures["over_default"]):
        return MISSING
    ends = f"{significant(figures['over_default_lower'])} … {significant(figures['over_default_upper'])}"
    return f"{significant(figures['over_default'])} ({ends})"


def _estimator_section(
    estimators: Sequence[EstimatorFigures], frequency: FloatArray, campaign: Campaign, group: int
) -> Section:
    lead = (
        f"Estimates from {group} realizations against the best linear approximation from all {campaign.realizations},"
        f" with compensation {campaign.estimate.compensation_kind}."
    )
    error = [(one.name, one.error_hz) for one in estimators]
    honesty = [(one.name, one.std_ratio_hz) for one in estimators]
    figures = (
        _figure("Error on the diagonal", "Relative error, median", frequency, error),
        _figure("Reported over true standard deviation, diagonal", "Ratio, median", frequency, honesty, log_y=False),
    )
    return Section("Estimators", lead, (_estimator_table(estimators, campaign.estimate.estimator, group), *figures))


def _estimator_table(estimators: Sequence[EstimatorFigures], default: str, group: int) -> Table:
    parts = ("diagonal.median_error", "diagonal.q90_error", "off_diagonal.median_error", "off_diagonal.q90_error")
    rows = tuple(
        (
            one.name,
            *(percent(one.figures[key]) for key in (*parts, "median_bias")),
            significant(one.figures["std_ratio"]),
            _share(one),
            _count(one.figures["refused"]),
        )
        for one in estimators
    )
    heads = ("Estimator", "Diagonal, median", "90 %", "Off diagonal, median", "90 %", "Bias, median")
    return Table(
        (*heads, "Reported over true deviation", "Error over the default's", "Refused"),
        rows,
        caption=(
            f"Root mean square of the relative error over the groups of {group} realizations; median and 90 % quantile"
            " over lines, elements and configurations. Bias: of the mean over the groups. Reported over true deviation:"
            " 1 where the covariance is honest. Error over the default's: ratio of the medians with its 95 % interval"
            " from a bootstrap over the groups. Stressed: the default that follows."
        ),
        strong=[one.name for one in estimators].index(following_default(estimators, default)),
    )


def _bias_section(biases: Sequence[BiasFigures], frequency: FloatArray, group: int, realizations: int) -> Section:
    keys = ("median_diagonal", "q90_diagonal", "median_off_diagonal", "median_diagonal_of_group")
    rows = tuple(
        (one.name, *(percent(one.figures[key]) for key in keys), _count(one.figures["refused"])) for one in biases
    )
    heads = ("Diagonal, median", "90 %", "Off diagonal, median", f"Diagonal, median of {group} realizations", "Refused")
    caption = (
        f"Last but one: distance of a single estimate, its scatter included. What silent_lines"
        f" subtracts is identified from the first {group} realizations of each task, in one configuration."
    )
    lead = (
        f"Best linear approximation from {realizations} realizations against the true robot's linearisation without"
        " friction: |G_hat/G - 1| with each compensation of the friction."
    )
    figure = _figure(
        "Bias on the diagonal", "Relative bias, median", frequency, [(one.name, one.bias_hz) for one in biases]
    )
    return Section("Compensation", lead, (Table(("Compensation", *heads), rows, caption=caption), figure))


def _figure(
    title: str, y_title: str, frequency: FloatArray, curves: Sequence[tuple[str, FloatArray]], *, log_y: bool = True
) -> Figure:
    x = tuple(frequency.tolist())
    known = tuple(Curve(name, x, tuple(y.tolist())) for name, y in curves if any(map(math.isfinite, y)))
    return Figure(title, "Frequency [Hz]", y_title, known, log_y=log_y)
