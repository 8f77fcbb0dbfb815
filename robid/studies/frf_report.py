"""What the study of estimators found: tables, figures, and which default follows."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robid.arrays import FloatArray
from robid.artifacts.artifact import Artifact
from robid.report.content import Verdict
from robid.report.numbers import percent, significant
from robid.report.section import Curve, Figure, Section, Table
from robid.settings.load import LoadedExperiment
from robid.studies.conclusion import Conclusion
from robid.studies.frf import campaign_of, compared, compensations
from robid.studies.frf_figures import (
    BiasFigures,
    EstimatorFigures,
    bias_figures,
    estimator_figures,
    gather,
    true_response,
)

_WORTH = 0.98  # another estimator is worth a new default only where its error is surely below this share


def conclude(loaded: LoadedExperiment, results: list[Artifact]) -> Conclusion:
    """Turns the tasks' results into figures, tables and the default that follows."""
    found = gather(results)
    study, campaign, _ = campaign_of(loaded)
    own, kinds = campaign.estimate, compensations(study, campaign)
    place: dict[tuple[str, str], int] = {
        (each.estimator, each.compensation): index for index, each in enumerate(compared(study, campaign))
    }
    reference = found.whole[kinds.index(own.compensation)]
    default = found.response[place[own.estimator, own.compensation]]
    estimators = [
        estimator_figures(name, found.response[index], found.variance[index], reference, default)
        for (name, kind), index in place.items()
        if kind == own.compensation
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
            _estimator_section(estimators, frequency, own.compensation, study.group, campaign.realizations),
            _bias_section(biases, frequency, study.group, campaign.realizations),
        ),
        warnings=tuple(f"{name} refused: {reason}." for name, reason in refusals if reason),
    )


def default_sentence(estimators: Sequence[EstimatorFigures], default: str) -> str:
    """Says which estimator follows as the default: another one only where it is surely and markedly closer."""
    closer = [one for one in estimators if one.figures["over_default_upper"] < _WORTH]
    if closer:
        best = min(closer, key=lambda one: one.figures["over_default"])
        return (
            f"The default should be `{best.name}`: its median error is {_share(best)} of that of `{default}`,"
            " the present one."
        )
    others = [one for one in estimators if one.name != default and math.isfinite(one.figures["over_default"])]
    if not others:
        return f"`{default}` stays the default: nothing else was compared."
    best = min(others, key=lambda one: one.figures["over_default"])
    return f"`{default}` stays the default: the error of the best other, `{best.name}`, is {_share(best)} of its own."


def bias_sentence(biases: Sequence[BiasFigures]) -> str:
    """Says what each compensation leaves of the bias."""
    left = [f"{percent(one.figures['median_diagonal'])} with compensation {one.name}" for one in biases]
    return f"Median bias on the diagonal: {', '.join(left)}."


def _share(one: EstimatorFigures) -> str:
    figures = one.figures
    ends = f"{significant(figures['over_default_lower'])} … {significant(figures['over_default_upper'])}"
    return f"{significant(figures['over_default'])} ({ends})"


def _estimator_section(
    estimators: Sequence[EstimatorFigures], frequency: FloatArray, compensation: str, group: int, realizations: int
) -> Section:
    columns = ("Estimator", "Diagonal, median", "90 %", "Off diagonal, median", "90 %", "Bias, median")
    rows = tuple(
        (
            one.name,
            *(percent(one.figures[f"diagonal.{key}"]) for key in ("median_error", "q90_error")),
            *(percent(one.figures[f"off_diagonal.{key}"]) for key in ("median_error", "q90_error")),
            percent(one.figures["median_bias"]),
            significant(one.figures["std_ratio"]),
            _share(one),
            significant(one.figures["refused"]),
        )
        for one in estimators
    )
    best = min(range(len(rows)), key=lambda index: _known(estimators[index].figures["median_error"]))
    table = Table(
        (*columns, "Reported over true deviation", "Error over the default's", "Refused"),
        rows,
        caption=(
            f"Root mean square of the relative error over the groups of {group} realizations; median and 90 % quantile"
            " over lines, elements and configurations. Bias: of the mean over the groups. Reported over true deviation:"
            " 1 where the covariance is honest. Error over the default's: ratio of the medians with its 95 % interval"
            " from a bootstrap over the groups."
        ),
        strong=best,
    )
    figure = Figure(
        "Error on the diagonal",
        "Frequency [Hz]",
        "Relative error, median",
        tuple(Curve(one.name, tuple(frequency.tolist()), tuple(one.error_hz.tolist())) for one in estimators),
    )
    lead = (
        f"Estimates from {group} realizations against the best linear approximation from all {realizations},"
        f" with compensation {compensation}."
    )
    return Section("Estimators", lead, (table,), (figure,))


def _bias_section(biases: Sequence[BiasFigures], frequency: FloatArray, group: int, realizations: int) -> Section:
    keys = ("median_diagonal", "q90_diagonal", "median_off_diagonal", "median_diagonal_of_group")
    rows = tuple(
        (one.name, *(percent(one.figures[key]) for key in keys), significant(one.figures["refused"])) for one in biases
    )
    heads = ("Diagonal, median", "90 %", "Off diagonal, median", f"Diagonal, median of {group} realizations", "Refused")
    caption = "Last but one: distance of a single estimate, its scatter included."
    figure = Figure(
        "Bias on the diagonal",
        "Frequency [Hz]",
        "Relative bias, median",
        tuple(Curve(one.name, tuple(frequency.tolist()), tuple(one.bias_hz.tolist())) for one in biases),
    )
    lead = (
        f"Best linear approximation from {realizations} realizations against the true robot's linearisation without"
        " friction: |G_hat/G - 1| with each compensation of the friction."
    )
    return Section("Compensation", lead, (Table(("Compensation", *heads), rows, caption=caption),), (figure,))


def _known(value: float) -> float:
    return value if math.isfinite(value) else math.inf
