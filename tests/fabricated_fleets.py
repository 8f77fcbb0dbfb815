"""Ledgers of fleets that nobody measured, with known faults."""

from dataclasses import replace

import numpy as np

from robid.fleet.comparison import Found, collect, compare
from robid.fleet.ledger import Ledger, RowError
from robid.fleet.manifest import Manifest, robots_of
from robid.settings.placeholders import Row

KNOWN = 0.01
SPREAD = 0.02
PARAMETERS = {
    "gear_a1.stiffness": ("stiffness", "N m/rad", 1e6),
    "gear_a2.stiffness": ("stiffness", "N m/rad", 2e6),
    "gear_a1.damping": ("damping", "N m s/rad", 300.0),
    "delay": ("delay", "s", 1e-3),
}


def entry(name, value, **changed):
    """A parameter that a row found; everything is known to one per cent."""
    kind, unit, nominal = PARAMETERS[name]
    ends = {"_low": value * (1 - 1.96 * KNOWN), "": value, "_high": value * (1 + 1.96 * KNOWN)}
    return {
        "fit": "elastic", "parameter": name, "kind": kind, "unit": unit, "joint": "a1", "tied_to": "",
        "nominal": nominal, "estimate": value, "standard_deviation": KNOWN * value,
        "relative_standard_deviation": KNOWN, "predicted_relative_standard_deviation": KNOWN,
        **{f"{which}{end}": number for which in ("effective", "physical") for end, number in ends.items()},
        "confidence": 0.95, "identifiable": True, "identified": True, "model_sha256": "m",
    } | changed  # fmt: skip


def ledger(name, results=(), misfit=None, grade=(2, "Trust."), **changed):
    made = Ledger(
        id=name, settings_hash="s", settings={}, inputs={}, outputs={}, status="done", error=None, warnings=(),
        grades={"elastic": grade}, results=tuple(results), kept=False, seconds=1.0, finished_utc="",
        misfits={} if misfit is None else {"elastic": {"misfit": misfit}},
    )  # fmt: skip
    return replace(made, **changed)


def failed(name, message, kind="data"):
    error = RowError(kind, f"logs/{name}.csv", message, "log again")
    return ledger(name, status="failed", error=error, grades={})


def sound(count, seed=1):
    """Robots whose parameters differ by two per cent."""
    generator = np.random.default_rng(seed)
    spread = np.hypot(SPREAD, KNOWN)
    for number in range(count):
        drawn = generator.standard_normal(len(PARAMETERS) + 1)
        results = [
            entry(name, about[2] * np.exp(spread * own))
            for (name, about), own in zip(PARAMETERS.items(), drawn, strict=False)
        ]
        yield ledger(f"r{number}", results, float(np.exp(0.05 * drawn[-1])))


def with_factor(made, name, factor):
    """The row with one parameter multiplied."""
    results = tuple(
        entry(name, each["estimate"] * factor) if each["parameter"] == name else each for each in made.results
    )
    return replace(made, results=results)


def robots_for(ledgers, **columns):
    """Whose measurements rows are, by columns of their manifest."""
    rows = tuple(
        Row(each.id, f"fleet.csv:{line}", None, {name: values[line - 2] for name, values in columns.items()})
        for line, each in enumerate(ledgers, start=2)
    )
    return robots_of(Manifest(None, tuple(columns), rows))


def found_in(ledgers, rows=None, **columns):
    """All that the page is made from."""
    collected = collect(ledgers)
    comparison = compare(collected, robots_for(ledgers, **columns))
    return Found("arms", [each.outline for each in ledgers], comparison, collected, rows)
