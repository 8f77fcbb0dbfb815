"""A choice of configurations in words, tables and pictures."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray, check_shape
from robid.design.configurations.information import ConfigurationDesign, Stability
from robid.report.charts import Skeletons
from robid.report.numbers import duration, joint_text, number_of, percent, significant
from robid.report.section import Bars, Section, Table
from robid.signals.quantities import readable, readable_units

_MM = 1e3
_NO_WEIGHT = 1e-4


def _whose(design: ConfigurationDesign) -> str:
    if design.criterion == "prediction":
        return f"error in predicted {PREDICTED[design.predict]}"
    return f"parameters' {_CRITERIA[design.criterion]}"


def worth_phrase(design: ConfigurationDesign) -> str:
    """Says how near a choice is to the best one."""
    share = percent(design.efficiency)
    if design.criterion == "prediction":
        return f"no choice has less than {share} of its mean square error"
    bound = "what optimal weights could give" if np.isnan(design.rounding_loss) else "the best that there is"
    return f"worth {share} of {bound}"


def skeleton_figure(
    points_m: FloatArray, weights: FloatArray, names: tuple[str, ...], candidates_m: FloatArray | None = None
) -> Skeletons:
    """Shows the chosen configurations (n_conf, n_point, 3) as arms in space, points from base to tool [m].

    Tool points of the candidates that were not chosen (n_candidate, 3) stand beside them.
    """
    check_shape("points_m", points_m, "n_conf n_point xyz", n_conf=len(names), xyz=3)
    return Skeletons(
        title="The chosen configurations",
        names=names,
        points=tuple(_triples(arm) for arm in points_m),
        weights=tuple(weights.tolist()),
        others=() if candidates_m is None else _triples(candidates_m),
        caption="Drag to turn. A thicker arm has more visits; its tool is the large dot, the floor the grey plane.",
    )


def weight_figure(weights: FloatArray, names: tuple[str, ...]) -> Bars:
    """Shows the weight lambda of each candidate that has any."""
    shown = np.flatnonzero(weights >= _NO_WEIGHT)
    return Bars(
        title="Weights",
        value_title="\u03bb",
        labels=tuple(names[index] for index in shown),
        parts=(("\u03bb", tuple(weights[shown].tolist())),),
        label_title="Configuration",
        caption="Shares of the experiments in the relaxed optimum; candidates without weight are left out.",
    )


def information_figure(information: FloatArray, parameters: tuple[str, ...], names: tuple[str, ...]) -> Bars:
    """Shows the weighted information (n_conf, n_param) of each configuration about each parameter, the diagonal."""
    shares = information / information.sum(axis=0)
    return Bars(
        title="Information per parameter",
        value_title="Share of the information",
        labels=parameters,
        parts=tuple((name, tuple(row.tolist())) for name, row in zip(names, shares, strict=True)),
        flat=True,
        caption="Weighted diagonal of the information matrices, other parameters taken as known.",
    )


def _triples(points: FloatArray) -> tuple[tuple[float, float, float], ...]:
    return tuple((float(x), float(y), float(z)) for x, y, z in points)


_CRITERIA = {
    "d": "volume (D)",
    "a": "mean variance (A)",
    "e": "worst combination (E)",
    "prediction": "error in predictions (prediction)",
}
PREDICTED = {
    "response": "responses",
    "resonances": "resonances",
    "tool_displacement": "tool displacement",
    "feedforward_torque": "feed-forward torques",
}
"""What a model is to predict, in words."""
_WAYS = {
    "d": "criterion d",
    "a": "criterion a",
    "e": "criterion e",
    "prediction": "criterion prediction",
    "random": "random, median",
    "random_best": "random, best tenth",
    "random_worst": "random, worst tenth",
}
_OTHER = {"realizations": "half of the realizations", "draws": "single draws of the parameters"}
_NEXT = 5


def stability_sentence(stability: Stability) -> str:
    """Says how much of a choice would come out the same."""
    kept, worst = (percent(float(value)) for value in (stability.kept.mean(), stability.kept.min()))
    efficiency = percent(float(stability.efficiency.mean()))
    rest = "the other half" if stability.source == "realizations" else "all of them"
    return (
        f"{_OTHER[stability.source]} choose {kept} of it again ({worst} at least), choices worth {efficiency} by {rest}"
    )


def next_best(design: ConfigurationDesign) -> list[int]:
    """Returns the candidates whose visit adds most, the best first."""
    return [int(index) for index in np.argsort(-design.gain, kind="stable")[:_NEXT]]


def design_tables(design: ConfigurationDesign) -> tuple[Table, ...]:
    """Lays out what was chosen, how good it is, what it promises, and what to measure next."""
    others = (alternative_table(design),) if design.alternatives else ()
    return (_chosen(design), _quality(design), _promised(design), *others, _next(design))


def design_section(name: str, design: ConfigurationDesign, arms_m: FloatArray) -> Section:
    """Lays out a choice for the page, with the arm (n_conf, n_point, 3) in each candidate, the tool last [m]."""
    every = tuple(number_of(index) for index in range(len(arms_m)))
    names = tuple(every[index] for index in design.chosen)
    visits = design.counts[design.chosen]
    figures = (
        skeleton_figure(
            arms_m[design.chosen],
            visits / visits.sum(),
            tuple(
                f"{name}, {count} visit{'s' * (count > 1)}" for name, count in zip(names, visits.tolist(), strict=True)
            ),
            np.delete(arms_m[:, -1], design.chosen, axis=0),
        ),
        weight_figure(design.weights, every),
        information_figure(design.told, design.parameter_names, names),
        *((alternative_figure(design),) if design.alternatives else ()),
    )
    lead = f"{len(names)} of {len(every)} candidates, made to keep the {_whose(design)} small; {worth_phrase(design)}."
    return Section(f"Design {name}", lead, (*design_tables(design), *figures))


def _chosen(design: ConfigurationDesign) -> Table:
    costly = design.cost_s is not None
    columns = ("Candidate", *_joints(design), "Visits", "\u03bb", *(("Cost",) * costly))
    rows = []
    for index in design.chosen.tolist():
        cost = (duration(float(design.cost_s[index])),) if design.cost_s is not None else ()
        weight = f"{design.weights[index]:.3f}" if design.weights[index] > 0 else "0"
        rows.append((number_of(index), *_written(design, int(index)), str(design.counts[index]), weight, *cost))
    return Table(
        columns,
        tuple(rows),
        title=f"Chosen configurations [{', '.join(dict.fromkeys(joint_units(design)))}]",
        caption="\u03bb is the weight in the relaxed optimum over all candidates, which needs no whole numbers: a"
        " candidate may be chosen without weight where few configurations must do.",
    )


def _quality(design: ConfigurationDesign) -> Table:
    worth = "Bound on the mean square error" if design.criterion == "prediction" else "Efficiency"
    rows = [
        ("Criterion", _CRITERIA[design.criterion]),
        ("Certified gap of the weights", significant(design.gap, 2)),
        ("Candidates with weight", str(int((design.weights > 0).sum()))),
        (f"{worth} against any weights", percent(design.efficiency)),
        (f"{worth} against as many configurations", percent(design.choice_efficiency)),
        *((("Lost by whole numbers", percent(design.rounding_loss)),) if np.isfinite(design.rounding_loss) else ()),
    ]
    if design.stability is not None:
        rows += [
            (f"Chosen again by {_OTHER[design.stability.source]}", percent(float(design.stability.kept.mean()))),
            ("Efficiency of such choices elsewhere", percent(float(design.stability.efficiency.mean()))),
        ]
    return Table(
        ("Quality of the choice", "Value"),
        tuple(rows),
        caption="No weights of the candidates are worth more than 1 + gap times the optimal ones found.",
    )


def alternative_table(design: ConfigurationDesign) -> Table:
    """Lays out what as many configurations would give by each way to choose them."""
    heads = ("Chosen by", "Median", "Worst", "Prediction", "Noise", "Lacking", "Resonances")
    rows = tuple(
        (
            _WAYS[each.way] + (" (this one)" if each.way == design.criterion else ""),
            *(
                percent(value)
                for value in (
                    each.relative_std,
                    each.worst_relative_std,
                    each.prediction_error,
                    each.noise_error,
                    each.bias_error,
                )
            ),
            percent(each.resonance_error) if np.isfinite(each.resonance_error) else "none",
        )
        for each in design.alternatives
    )
    return Table(
        heads,
        rows,
        title="What as many configurations give",
        caption="Median and worst: of the parameters' relative deviations. Prediction: expected relative error of"
        f" {PREDICTED[design.predict]} (root mean square), by the priors of what the robot file may have wrong when the"
        " choice was made, with its parts by noise and by what the model lacks; resonances: the same of undamped"
        " resonances. Criteria d, a and e serve a model whose springs are wanted, prediction one that predicts.",
    )


def alternative_figure(design: ConfigurationDesign) -> Bars:
    """Shows the same: deviations of the parameters and errors of predictions."""
    resonant = all(np.isfinite(each.resonance_error) for each in design.alternatives)
    return Bars(
        title="What as many configurations give",
        value_title="Relative deviation [%]",
        labels=tuple(_WAYS[each.way] for each in design.alternatives),
        parts=(
            ("parameters", tuple(100 * each.relative_std for each in design.alternatives)),
            ("prediction", tuple(100 * each.prediction_error for each in design.alternatives)),
            *((("resonances", tuple(100 * each.resonance_error for each in design.alternatives)),) if resonant else ()),
        ),
        flat=True,
        label_title="Chosen by",
        caption="Median of the parameters' relative deviations, and the relative error (root mean square) of predicted"
        f" {PREDICTED[design.predict]} and of resonances.",
    )


def _promised(design: ConfigurationDesign) -> Table:
    heads = ["Parameter", "Predicted deviation"]
    columns = [design.parameter_names, _percents(design.predicted_relative_std)]
    caption = (
        "Relative standard deviation after one visit to each chosen configuration, or as many as stated, each with the"
        " experiments of the candidates' campaign."
    )
    if design.between_relative_std is not None:
        heads.append("Between configurations")
        columns.append(_percents(design.between_relative_std))
        caption += " Between configurations: how far a parameter was taken to differ from one to another."
    return Table(tuple(heads), tuple(zip(*columns, strict=True)), caption=caption)


def _percents(deviations: FloatArray) -> tuple[str, ...]:
    return tuple(percent(deviation) for deviation in deviations.tolist())


def _next(design: ConfigurationDesign) -> Table:
    rows = []
    for index in next_best(design):
        gain, chosen = significant(float(design.gain[index])), "yes" if index in design.chosen else "no"
        rows.append((number_of(index), *_written(design, index), gain, chosen))
    caption = "Gain of log det by one visit more: beyond the earlier fit where one is named, else beyond the choice."
    if design.criterion == "prediction":
        caption = (
            "Gain: share of the mean square error of predictions that one visit more takes off, beyond the choice."
        )
    return Table(("Measure next", *_joints(design), "Gain", "Chosen"), tuple(rows), caption=caption)


def _joints(design: ConfigurationDesign) -> tuple[str, ...]:
    return tuple(f"q{number_of(index)}" for index in range(design.configurations.shape[1]))


def joint_units(design: ConfigurationDesign) -> tuple[str, ...]:
    """Returns the units in which the joints' positions are written."""
    return readable_units(design.joint_units, design.configurations.shape[1])


def _written(design: ConfigurationDesign, index: int) -> tuple[str, ...]:
    values = readable(design.configurations[index], design.joint_units).tolist()
    return tuple(joint_text(value, unit) for value, unit in zip(values, joint_units(design), strict=True))
