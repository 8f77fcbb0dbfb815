"""The file `fleet.json`: failures by cause, populations, outliers and drifts, for programs.

Schema history:
    1.1: `repeated` and `followed`; the group of a fleet without groups is `all`.
    1.0: the first.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

from robid.artifacts.atomic import json_text, read_json, write_json
from robid.errors import ArtifactError
from robid.files import read_regular_text
from robid.fleet.comparison import Compared, Comparison
from robid.fleet.drift import Drift
from robid.fleet.ledger import Ledger, causes
from robid.fleet.population import LEVEL, Outlier
from robid.versions import __version__

SUMMARY_VERSION = "1.1"
_KIND = "fleet"


def check_summary(path: Path) -> None:
    """Refuses to start where another file is in its place.

    Raises:
        ArtifactError: If it is so.
    """
    if not path.exists():
        return
    try:
        found = read_json(path)
    except ArtifactError:
        found = None
    if not isinstance(found, dict) or found.get("kind") != _KIND:
        remedy = "move it away, or name another run folder with --run-dir"
        message = "A027 There is a file that is no fleet.json of robid, or a damaged one."
        raise ArtifactError(message, where=str(path), remedy=remedy)


def write_summary(path: Path, name: str, ledgers: Sequence[Ledger], comparison: Comparison) -> Literal["made", "fresh"]:
    """Writes the file unless the one that is there says the same."""
    content = {
        "kind": _KIND,
        "schema_version": SUMMARY_VERSION,
        "robid_version": __version__,
        "experiment": name,
        "rows": len(ledgers),
        "robots": len(comparison.robots.names),
        "level": LEVEL,
        "failures": [
            {"kind": kind, "message": message, "remedy": remedy, "count": len(ids), "rows": ids}
            for kind, message, remedy, ids in causes(ledgers)
        ],
        "untold": [comparison.robots.groups[group] for group in comparison.untold],
        "populations": _populations(comparison),
        "outliers": [_outlier(comparison, each, ledgers) for each in comparison.outliers],
        "repeated": comparison.robots.repeated,
        "followed": len(comparison.followed),
        "time_unit": comparison.robots.time_unit,
        "drifts": [_drift(comparison, each) for each in comparison.drifts],
    }
    if path.exists() and read_regular_text(path) == json_text(content):
        return "fresh"
    write_json(path, content)
    return "made"


def _populations(comparison: Comparison) -> list[dict[str, Any]]:
    """Centre and spread in the unit of the values, the spread relative where they are compared by logarithms."""
    return [
        {
            "fit": each.fit,
            "name": each.name,
            "group": comparison.robots.groups[each.group],
            "unit": each.of.unit,
            "robots": each.population.robots,
            "rows": len(each.trait.rows),
            "relative": each.of.is_logarithmic,
            "centre": each.natural(each.population.centre),
            "spread": each.population.spread,
        }
        for each in comparison.compared
        if each.population is not None
    ]


def _outlier(comparison: Comparison, outlier: Outlier, ledgers: Sequence[Ledger]) -> dict[str, Any]:
    of, robots = comparison.compared[outlier.trait], comparison.robots
    value, low, high = of.interval(outlier.row)
    known = of.population
    about = {} if known is None else {"centre": of.natural(known.centre), "spread": known.spread}
    return {
        "row": ledgers[outlier.row].id,
        "robot": robots.names[robots.robot[outlier.row]],
        **_named(comparison, of),
        "value": value,
        "low": low,
        "high": high,
        **about,
        "away": outlier.away,
        "chance": outlier.chance,
    }


def _drift(comparison: Comparison, drift: Drift) -> dict[str, Any]:
    """Slope and change, relative where the values are compared by logarithms."""
    of = comparison.compared[drift.trait]
    return {
        "robot": comparison.robots.names[drift.robot],
        **_named(comparison, of),
        "measurements": drift.count,
        **_with_ends("slope", of, drift.slope, drift.slope_half_width),
        **_with_ends("change", of, drift.change, drift.change_half_width),
        "chance": drift.chance,
    }


def _named(comparison: Comparison, of: Compared) -> dict[str, Any]:
    return {
        "group": comparison.robots.groups[of.group],
        "fit": of.fit,
        "name": of.name,
        "unit": of.of.unit,
        "relative": of.of.is_logarithmic,
    }


def _with_ends(name: str, of: Compared, middle: float, half: float) -> dict[str, float]:
    ends = {name: middle, f"{name}_low": middle - half, f"{name}_high": middle + half}
    return {end: of.change(value) for end, value in ends.items()}
