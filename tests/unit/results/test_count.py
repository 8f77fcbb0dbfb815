"""One count of identified parameters: phrase, page, terminal, summary and Python give the same."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from robid.face.parameters import Parameters
from robid.models.elastic import fitting
from robid.models.elastic.fitting import phrase_of_model
from robid.report.parameter_section import count_identified, identified_phrase, parameter_numbers
from robid.report.parameters import Estimates, ParameterRow
from robid.results.estimate import Estimate

KINDS = ("stiffness", "damping", "friction", "friction")
WIDTH = np.array([0.01, 3.0, 0.01, 0.01])


def estimate():
    """A spring and a friction coefficient or two that are identified, a damper that is not."""
    ones = np.ones(4)
    return Estimate(
        names=("a.stiffness", "a.damping", "m.coulomb", "m.viscous"),
        kinds=KINDS,
        units=("N m/rad", "N m s/rad", "1", "1"),
        nominal=ones,
        value=ones,
        lower=ones - WIDTH,
        upper=ones + WIDTH,
        covariance=np.diag(WIDTH**2),
        degrees_of_freedom=np.full(4, np.inf),
        confidence=0.95,
        interval_rule="",
        relative_std=WIDTH / 2,
        predicted_relative_std=WIDTH / 2,
        prior_relative_std=np.full(4, np.inf),
        relative_half_width=WIDTH,
        identifiable=np.ones(4, bool),
        identifiable_relative_std=0.2,
        undetermined=(),
        status="converged",
        advice="",
    )


def test_corrections_of_friction_are_no_parameters_of_the_model_anywhere(monkeypatch):
    found = estimate()
    assert found.count == (1, 2)
    rows = tuple(
        ParameterRow(name, kind, unit, 1.0, 1.0, 1 - width, 1 + width, width / 2, identified=known)
        for name, kind, unit, width, known in zip(
            found.names, KINDS, found.units, WIDTH, found.identified.tolist(), strict=True
        )
    )
    assert count_identified(rows) == 1
    assert next(iter(parameter_numbers(Estimates(rows)))).detail == "1 of 2 parameters"
    dampers = tuple(replace(row, kind=row.kind.replace("stiffness", "damping")) for row in rows)
    assert identified_phrase(Estimates(dampers)).startswith("1 of 2 parameters")
    assert Parameters(found).counted.startswith("1 of 2 parameters identified, 2 more")
    starts = SimpleNamespace(minimum=np.zeros(1), evaluations=np.zeros(0), cap_share=0.0, cost=np.ones(1))
    costs = SimpleNamespace(expected=np.zeros(1), configuration=np.ones(1), total=1.0)
    solution = SimpleNamespace(estimate=found, starts=starts, costs=costs)
    monkeypatch.setattr(fitting, "solution_from_artifact", lambda _: solution)
    assert "1 of 2 parameters identified" in phrase_of_model(None)
