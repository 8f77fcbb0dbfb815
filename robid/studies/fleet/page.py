"""Tables and figures of the study of fleets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

from robid.arrays import FloatArray
from robid.report.numbers import significant
from robid.report.section import Cell, Curve, Figure, Section, Table
from robid.studies.fleet.check import KINDS
from robid.studies.fleet.robots import Fault, FleetRobot

_TITLES = {
    "spring": "A softened spring",
    "sign": "A wrong sign",
    "dead": "A dead channel",
    "gap": "Lost samples",
    "payload": "A wrong payload",
    "file": "A damaged file",
}


def faults_section(robots: Sequence[FleetRobot], values: Mapping[str, Any], figures: Mapping[str, float]) -> Section:
    """What became of each fault, and which sound robots are accused.

    Args:
        robots: The robots.
        values: Of each (n_row,): `failed`, `off`, and what is `told` of it.
        figures: Figures by name.
    """
    counts = tuple(
        (
            _TITLES[kind],
            str(sum(robot.kind == kind for robot in robots)),
            f"{figures[f'fleet.{kind}.found']:.0f}",
            f"{figures[f'fleet.{kind}.failed']:.0f}",
        )
        for kind in KINDS
        if f"fleet.{kind}.found" in figures
    )
    rows = []
    for index, robot in enumerate(robots):
        named = bool(values["failed"][index] or values["off"][index])
        if robot.fault is None and not named:
            continue
        what = "sound" if robot.fault is None else said(robot.fault)
        became = "failed" if values["failed"][index] else "an outlier" if named else "not found"
        good = named == (robot.fault is not None)
        rows.append((robot.name, what, Cell(became, "" if good else "bad"), str(values["told"][index])))
    each = Table(
        ("Robot", "What is wrong", "It is", "What is said"),
        tuple(rows),
        title="Robots with a fault, and sound ones that are accused",
        prose=True,
        fit="tall",
    )
    lead = (
        "Found is a fault whose row failed or is on the list of outliers; accused is a sound robot of which that is"
        " true. A grade accuses nobody."
    )
    head = ("Fault", "Robots", "Found", "of them failed")
    return Section("Faults", lead, (Table(head, counts, title="By kind", fit="compact"), each))


def said(fault: Fault) -> str:
    """Says what is wrong with a robot or its log."""
    channel = f"{fault.channel} of joint {fault.joint + 1}"
    return {
        "spring": f"transmission of joint {fault.joint + 1} softened",
        "sign": f"sign of the {channel}",
        "dead": f"{channel} dead, {fault.variant}",
        "gap": f"{fault.samples} samples lost",
        "payload": "another payload mounted",
        "file": f"file {fault.variant}",
    }[fault.kind]


def memory_section(memory: FloatArray, settled: int) -> tuple[Section, ...]:
    """How the memory of the worker grew; nothing where it was not watched.

    Args:
        memory (n_done,): After each row [MiB].
        settled: Number of rows after which growth counts.
    """
    if len(memory) <= settled:
        return ()
    curve = Curve("worker", tuple(float(number) for number in range(1, len(memory) + 1)), tuple(memory.tolist()))
    figure = Figure("Memory after each row", "Row", "Resident memory [MiB]", (curve,), log_x=False, log_y=False)
    lead = f"Of the one worker process that reprocessed the fleet; growth is counted from the {settled}th row on."
    return (Section("Memory", lead, (figure,)),)


def speed_section(
    rates: Mapping[tuple[str, int], Sequence[float]], serial: tuple[str, int], rows: int, cores: int
) -> Section:
    """How fast each backend was.

    Args:
        rates: Rows a second of each run, by backend and number of workers.
        serial: The backend that the others are held against.
        rows: Rows of each run.
        cores: Cores of the machine.
    """
    middle = {way: median(found) for way, found in rates.items()}
    table = Table(
        ("Backend", "Workers", "Rows a second, median", "Lowest", "Highest", "Each worker over serial"),
        tuple(
            (
                way[0],
                str(way[1]),
                significant(middle[way]),
                significant(min(found)),
                significant(max(found)),
                significant(middle[way] / way[1] / middle[serial]),
            )
            for way, found in rates.items()
        ),
        fit="compact",
    )
    lead = (
        f"`robid reprocess` on {rows} sound rows as a user would start it, backends in turn, on {cores} cores. Rows a"
        " second between the first and the last finished row: the start of the command and of its workers is not in"
        " it; of w workers, w rows count as finished with the first, which is rather too strict."
    )
    return Section("Speed", lead, (table,))
