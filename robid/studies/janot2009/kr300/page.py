"""What the many robots of six axes say of intervals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.artifacts.artifact import Artifact
from robid.pipeline.graph import Run
from robid.report.numbers import percent, significant
from robid.report.section import Section, Table
from robid.studies.janot2009.kr300.runs import JOINTS
from robid.studies.janot2009.section import study_of
from robid.studies.part import Asked, PartFound

_FRICTION = (".viscous", ".coulomb")


def conclude_kr300(run: Run, results: Sequence[Artifact]) -> PartFound | None:
    """Counts how often intervals held the truth, and how far friction and the rest were off."""
    if study_of(run.loaded).kr300 is None:
        return None
    figures: dict[str, float] = {}
    rows = []
    for name in JOINTS:
        own = [each for each in results if each.attributes["joints"] == name]
        if not own:
            continue
        found = _figures(own)
        prefix = "kr300." if name == "rigid" else "kr300.elastic."
        figures |= {f"{prefix}{key}": value for key, value in found.items()}
        rows.append(
            (
                name,
                f"{found['robots']:.0f}",
                percent(found["coverage_95"]),
                significant(found["rms_deviations"], 3),
                percent(found["median_friction_error"]),
                percent(found["worst_friction_error"]),
            )
        )
    heads = (
        "Joints",
        "Robots",
        "Intervals that hold",
        "Errors, in deviations",
        "Friction off (median)",
        "(worst mean)",
    )
    caption = (
        "95 % intervals of all base parameters; friction, ripple, resolver and encoder errors and torque noise are on."
        " Rigid joints are what the model assumes; the springs of elastic ones it does not know."
    )
    section = Section("Six axes: intervals against the truth", "", (Table(heads, tuple(rows), caption=caption),))
    return PartFound(figures, {"kr300.coverage_95": Asked(0.92, 0.98)}, (section,))


def _figures(results: Sequence[Artifact]) -> dict[str, float]:
    names = results[0].datasets["names"].values.tolist()
    value, truth, std, inside = (
        np.concatenate([each.datasets[key].values for each in results]) for key in ("value", "truth", "std", "inside")
    )
    friction = [index for index, name in enumerate(names) if name.endswith(_FRICTION)]
    error = np.abs(value[:, friction] / truth[:, friction] - 1)
    return {
        "robots": float(len(value)),
        "coverage_95": float(inside.mean()),
        "rms_deviations": float(np.sqrt(np.mean(((value - truth) / std) ** 2))),
        "median_friction_error": float(np.median(error)),
        "worst_friction_error": float(error.mean(axis=0).max()),
    }
