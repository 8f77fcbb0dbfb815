"""Figures 3 to 9 of Wernholt and Moberg (2008), drawn from our models."""

from __future__ import annotations

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray
from robid.report.section import Beside, Curve, Figure, Section
from robid.studies.wernholt2008.figures import NEAR_BEST, Found, Models
from robid.studies.wernholt2008.study import ALL

_PARAMETER_RANGE = (0.01, 100.0)
_COST_RANGE = (0.95, 20.0)
_ABOUT = {"": "by the strategy of this study", "plain": "by plain descents"}
_SORTED = "Start, by the cost with user weights"


def start_cost_section(found: Found, group: str) -> Section:
    """Figs 3 and 4: sorted costs of every estimator."""
    members = found.groups[group]
    first = max(len(one.own_cost) for one in members.values())
    x = tuple(float(number) for number in range(1, first + 1))
    figures = []
    for number, title, key in ((3, "user", "user_cost"), (4, "optimal", "optimal_cost")):
        curves = tuple(
            Curve(name, x, tuple(np.minimum(getattr(one, key)[one.order], _COST_RANGE[1]).tolist()))
            for name, one in members.items()
        )
        figures.append(
            Figure(
                f"Fig. {number}: cost with {title} weights",
                _SORTED,
                "Cost over the best",
                curves,
                log_x=False,
                y_range=_COST_RANGE,
            )
        )
    lead = (
        f"Models from the same starts {_ABOUT[group]}, all judged by the same two costs, each estimator's sorted by the"
        f" first. Costs above {_COST_RANGE[1]:g} are drawn there."
    )
    return Section(f"Costs {_ABOUT[group]}", lead, (Beside(tuple(figures), 2),))


def parameter_sections(found: Found, transmission: BoolArray) -> tuple[Section, ...]:
    """Figs 5 to 7: springs of gearboxes and of the arm structure for all estimators, dampers for LLS and LLSM."""
    spring = found.of_kind("stiffness")
    members = found.as_in_paper
    logarithmic = {name: one for name, one in members.items() if name.startswith("lls") and one.configuration == ALL}
    lead = (
        f"Divided by the best {found.reference} model's; plain descents where the study has them, sorted as in Fig. 3."
        " Values beyond the axis are drawn at its end."
    )
    panels = (
        ("Fig. 5: springs of the gearboxes", members, spring & transmission),
        ("Fig. 6: springs of the arm structure", members, spring & ~transmission),
        ("Fig. 7: dampers of the gearboxes", logarithmic, ~spring & transmission),
        ("Fig. 7: dampers of the arm structure", logarithmic, ~spring & ~transmission),
    )
    return tuple(
        Section(title, lead, (Beside(tuple(_parameter_figure(found, one, mask) for one in shown.values()), 3),))
        for title, shown, mask in panels
        if mask.any()
    )


def _parameter_figure(found: Found, models: Models, mask: BoolArray) -> Figure:
    relative = np.clip(np.exp(models.internal[models.order] - found.best), *_PARAMETER_RANGE)
    x = tuple(float(number) for number in range(1, len(relative) + 1))
    names = found.problem.parameters.names
    curves = tuple(
        Curve(names[index].rpartition(".")[0], x, tuple(relative[:, index].tolist())) for index in np.flatnonzero(mask)
    )
    return Figure(models.name, "", "", curves, log_x=False, y_range=_PARAMETER_RANGE, height=240)


def response_sections(found: Found, element: tuple[int, int]) -> tuple[Section, ...]:
    """Figs 8 and 9: the best model's response, the spread of the good ones, and the measurement."""
    alone = [one.configuration for one in found.near.values() if one.configuration != ALL]
    configuration = alone[0] if alone else 0
    best = found.problem.model_response(found.best)[configuration]
    return (_spread_section(found, configuration, element, best), _matrix_section(found, configuration, best))


def _spread_section(found: Found, configuration: int, element: tuple[int, int], best: ComplexArray) -> Section:
    output, motor = (number - 1 for number in element)
    models = found.as_in_paper[found.reference]
    near = models.internal[models.user_cost <= NEAR_BEST]
    curves = [_curve(found, "best", np.abs(best[:, output, motor]))]
    if len(near):
        kept = np.unique(np.round(near, 3), axis=0)
        size = np.array([np.abs(found.problem.model_response(one)[configuration, :, output, motor]) for one in kept])
        curves += [_curve(found, "smallest", size.min(axis=0)), _curve(found, "largest", size.max(axis=0))]
    figure = Figure(f"Element ({element[0]}, {element[1]})", "Frequency [Hz]", _UNIT, tuple(curves))
    lead = (
        f"Configuration {configuration + 1}: the best {found.reference} model and the range of its {len(near)} models"
        f" with a cost within {NEAR_BEST:g} of the best (paper: 31)."
    )
    return Section("Fig. 8: responses of the good models", lead, (figure,))


def _matrix_section(found: Found, configuration: int, best: ComplexArray) -> Section:
    frf = found.problem.frf
    measured = np.abs(frf.response[configuration])
    std = np.sqrt(frf.element_variance()[configuration])
    size = np.abs(best)
    figures = []
    for output, motor in np.ndindex(measured.shape[1:]):
        own = (slice(None), output, motor)
        curves = (
            _curve(found, "measured", measured[own]),
            _curve(found, "best model", size[own]),
            _curve(found, "minus one deviation", np.maximum(measured[own] - std[own], 1e-2 * measured[own])),
            _curve(found, "plus one deviation", measured[own] + std[own]),
        )
        title = f"{frf.output_names[output]} by {frf.input_names[motor]}"
        figures.append(Figure(title, "", "", curves, height=150, legend=False))
    lead = (
        f"Configuration {configuration + 1}: measured response (solid), best {found.reference} model (dashed) and one"
        f" standard deviation to each side (dots); [rad/(s² N m)] over [Hz]."
    )
    return Section("Fig. 9: measured and modelled response", lead, (Beside(tuple(figures), measured.shape[2]),))


_UNIT = "Magnitude [rad/(s² N m)]"


def _curve(found: Found, name: str, values: FloatArray) -> Curve:
    return Curve(name, tuple(found.problem.frf.frequency_hz.tolist()), tuple(values.tolist()))
