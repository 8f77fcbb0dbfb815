"""Logs of one simulated campaign in any form: format, dialect, units, signs, order, offsets, start, extra columns."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from any_log_text import Text
from linear_loop import LINES, N_SAMPLE, Loop
from log_files import WRITERS
from robid.frf.estimate import estimate_frf
from robid.frf.frf import Frf
from robid.frf.options import EstimateOptions
from robid.signals.quantities import Channel
from robid.signals.record import Record

JOINTS = ("turn", "lift")
FIRST, N_PERIOD = 2, 6
"""The period that the record begins with, and those that were played in all."""
STAMPS = {
    "iso": "%Y-%m-%dT%H:%M:%S.%fZ",
    "German": "%d.%m.%Y %H:%M:%S,%f",
    "US": "%m/%d/%Y %I:%M:%S.%f %p",
    "British": "%d/%m/%y %H:%M:%S.%f",
    "month": "%b %d %Y %H:%M:%S.%f",
    "clock": "%H:%M:%S.%f",
}
MIDNIGHT = datetime(2024, 5, 3, tzinfo=UTC)
"""In no order of its numbers another date is as close to the one before."""
TURNS = {"rad": 2 * np.pi, "mrad": 2e3 * np.pi, "deg": 360.0, "turn": 1.0}
MESSAGES = ("mcap", "rosbag")
"""Formats whose messages hold six numbers and a stamp each millisecond."""
INPUT_UNITS = {"N m": 1.0, "mN m": 1e-3, "kN m": 1e3, "A": 1.0, "mA": 1e-3}
OUTPUT_UNITS = {
    "angle": {"rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "deg": np.pi / 180, "turn": 2 * np.pi, "counts": None},
    "speed": {"rad/s": 1.0, "deg/s": np.pi / 180, "rpm": np.pi / 30, "counts/s": None},
    "acceleration": {"rad/s^2": 1.0, "deg/s^2": np.pi / 180},
}
REFERENCE_UNITS = {"rad/s": 1.0, "deg/s": np.pi / 180, "rpm": np.pi / 30}
UNIT_OF = {"angle": "rad", "speed": "rad/s", "acceleration": "rad/s^2"}


@dataclass(frozen=True)
class Plan:
    """What is chosen of a log.

    Attributes:
        kind: Its format.
        text: How it is written, where it is a table of text.
        packed: What it is packed by: `gz`, `bz2` or nothing.
        says_format: Whether the mapping names the format.
        places: Where the numbers of configuration, realization and experiment are: `file`, `variable` or `one`.
        split: Whether the outputs are in a file of their own.
        n_conf: Configurations.
        n_real: Realizations.
        periods: Periods that are used.
        step_s: Sampling period.
        motion: What the outputs are.
        precision: `full`, `single`, or `rounded`.
        references: Whether the references are logged, and matched to the excitation.
        excitation: How the lines are stated: `band`, `list` or `found`.
        start: Where the log begins: `record`, `earlier` (whole periods that are dropped), `before` (any samples, of
            which the last periods are taken, or which are found by the references), or `anywhere` in the period.
        rest: Whether the robot rests in what is before.
        time: Unit of the log's own time, or nothing.
        stamp: How its time is written as date or time of day, or nothing where it is a number.
        named: What is written behind the names of columns: their unit in some form, or nothing.
        matrix: Whether all channels are `columns` or `rows` of a matrix, or nothing.
        wraps: Whether the outputs, angles, begin anew after a turn.
        gaps: Whether samples are missing outside of what is used, and whole periods inside.
        disorder: Whether single rows stand too late, or twice.
        estimator: What estimates the response.
        seed: Of units, signs, scales, offsets, order and extra columns.
    """

    kind: str = "csv"
    text: Text = field(default_factory=Text)
    packed: str = ""
    says_format: bool = True
    places: str = "file"
    split: bool = False
    n_conf: int = 1
    n_real: int = 2
    periods: int = 3
    step_s: float = 1e-3
    motion: str = "angle"
    precision: str = "full"
    references: bool = False
    excitation: str = "list"
    start: str = "record"
    rest: bool = False
    time: str = ""
    stamp: str = ""
    named: str = ""
    matrix: str = ""
    wraps: bool = False
    gaps: bool = False
    disorder: bool = False
    estimator: str = "logarithmic"
    seed: int = 1

    @property
    def blocks(self) -> Iterator[tuple[int, int, int]]:
        """Indices of all experiments."""
        return np.ndindex(self.n_conf, self.n_real, 2)

    @property
    def is_exact(self) -> bool:
        """Whether the log holds the record's own samples, from its first one on."""
        counts = any(unit.startswith("counts") for unit in _units(self)[1])
        return self.precision == "full" and self.start != "anywhere" and not counts

    def file(self, part: str = "") -> str:
        """Name of its files, numbers to be put in; the outputs' own file begins with `out_`."""
        suffix = WRITERS[self.kind][1].partition(".")[2] + (f".{self.packed}" if self.packed else "")
        numbers = {
            "file": "c{configuration}_r{realization:02d}_e{experiment}",
            "variable": "c{configuration}",
            "one": "all",
        }[self.places]
        return f"{part}{numbers}.{suffix}"


@dataclass(frozen=True)
class Played:
    """A simulated campaign (2 configurations, 2 realizations, 2 experiments): signals, and a period of references."""

    torque: np.ndarray
    output: np.ndarray
    reference: np.ndarray


def play(reference: np.ndarray) -> Played:
    """Plays references (2, 2, n_sample, 2) in two configurations of a loop with noise."""
    both = np.stack([reference, reference])
    torque, angle = Loop(torque_noise=0.003, sensor_noise=1e-5).simulate(
        both, np.random.default_rng(8), periods=N_PERIOD
    )
    return Played(torque, angle, both)


def record_response(plan: Plan, played: Played) -> list[Frf]:
    """The response of the record itself, in each configuration."""
    inside = (slice(None), slice(plan.n_real), slice(None), slice(FIRST, FIRST + plan.periods))
    output = played.output[inside]
    record = Record(
        sampling_period_s=plan.step_s,
        configurations=np.zeros((2, 2)),
        inputs=played.torque[inside],
        outputs=output,
        reference=played.reference[:, : plan.n_real] if plan.references else None,
        reference_channels=tuple(Channel(name, "speed_reference", "rad/s") for name in JOINTS * plan.references),
        excited_lines=LINES,
        detection_lines=np.zeros(0, int),
        input_channels=tuple(Channel(name, "torque", "N m") for name in JOINTS),
        output_channels=tuple(Channel(name, plan.motion, UNIT_OF[plan.motion]) for name in JOINTS),
        output_offset=np.zeros((2, 2)),
    )
    options = EstimateOptions(estimator=plan.estimator, compensation="none")
    return [estimate_frf(_configuration(record, index), options) for index in range(plan.n_conf)]


def _configuration(record: Record, index: int) -> Record:
    one = slice(index, index + 1)
    changed = {key: getattr(record, key)[one] for key in ("configurations", "inputs", "outputs", "output_offset")}
    if record.reference is not None:
        changed["reference"] = record.reference[one]
    return replace(record, **changed)


def _units(plan: Plan) -> tuple[list[str], list[str], list[str]]:
    """Units of inputs, outputs and references."""
    generator = np.random.default_rng([plan.seed, 1])
    known = (INPUT_UNITS, OUTPUT_UNITS[plan.motion], REFERENCE_UNITS)
    inputs, outputs, references = ([str(unit) for unit in generator.choice(list(units), 2)] for units in known)
    return inputs, outputs, references


@dataclass
class Logs:
    """The logs of a plan before they are written: their settings, and columns by name for each experiment.

    Attributes:
        plan: What was chosen.
        channels: Settings of inputs, outputs and references, `variable` being the column's name.
        columns: Columns of each experiment.
        units: What the columns' units are, for a line of units.
        begin: Sample of each experiment's log at which the part that is used begins.
        drop_periods: Periods that are dropped.
        take: Which periods are used.
        period_samples: The period that is stated.
        lines: The lines that are stated, where the plan lists them.
        missing: A file that is taken away.
        cut: A file that is cut to half of its length.
    """

    plan: Plan
    channels: dict[str, list[dict[str, Any]]]
    columns: dict[tuple[int, ...], dict[str, np.ndarray]]
    units: dict[str, str]
    begin: dict[tuple[int, ...], int]
    drop_periods: int
    take: str
    period_samples: int = N_SAMPLE
    lines: list[int] = field(default_factory=LINES.tolist)
    missing: str = ""
    cut: str = ""

    def file_name(self, index: tuple[int, ...], part: str = "") -> str:
        """Name of the file of an experiment."""
        return self.plan.file(part).format(**numbers(index))


def numbers(index: tuple[int, ...]) -> dict[str, int]:
    """Numbers of configuration, realization and experiment, from 1."""
    return {key: at + 1 for key, at in zip(("configuration", "realization", "experiment"), index, strict=True)}


def lay_out(plan: Plan, played: Played) -> Logs:
    """Turns a campaign into the numbers of its logs."""
    generator = np.random.default_rng([plan.seed, 2])
    channels, factors, offsets, units = _channels(plan, played, generator)
    drop, take = int(generator.integers(1, 3)) * (plan.start == "earlier"), "first"
    if plan.start == "before" and not plan.references:
        take = "last"
    logs = Logs(plan, channels, {}, units, {}, drop, take)
    # What is in one file has one length.
    common = None if plan.places == "file" else _part(plan, drop, generator)
    order = generator.permutation(12)
    turns = _wrap(plan, channels["outputs"], offsets) if plan.wraps else {}
    for index in plan.blocks:
        begin, lead, tail = common or _part(plan, drop, generator)
        cut = slice(begin - lead, begin + plan.periods * N_SAMPLE + tail)
        signals = _signals(plan, played, index)
        columns = {}
        for name, signal in signals.items():
            values = signal[cut].copy()
            still = max(lead - drop * N_SAMPLE, 0) if plan.rest else 0
            values[:still] = values[still] if name.startswith("q") else 0.0
            columns[name] = _rounded(plan, values / factors[name] + offsets[name], units[name], name)
            if name in turns:
                columns[name] = (columns[name] + turns[name] / 2) % turns[name] - turns[name] / 2
        if plan.time and plan.kind not in MESSAGES:
            columns["t"] = _time(plan, lead, plan.periods * N_SAMPLE, tail, generator)
        columns |= _extra(plan, len(values))
        if plan.disorder:
            columns = _out_of_order(plan, columns, len(values))
        names = [name for _, name in sorted(zip(order, columns, strict=False))]
        logs.columns[index] = {name: columns[name] for name in names}
        logs.begin[index] = lead
    return logs


def _channels(plan: Plan, played: Played, generator: np.random.Generator) -> tuple[dict, dict, dict, dict]:
    """Settings of the channels, and each column's factor to SI, offset and unit."""
    settings, factors, offsets, units = {}, {}, {}, {}
    groups = zip(("inputs", "outputs", "references"), ("u", "q", "ref"), _units(plan), strict=True)
    for group, letter, chosen in groups:
        settings[group] = []
        for motor, unit in enumerate(chosen):
            name, sign = f"{letter}{motor + 1}", int(generator.choice([-1, 1]))
            scale = float(generator.choice([1, 1, 0.5, 3.7e-3, 1024]))
            channel = {"name": JOINTS[motor], "variable": name, "unit": unit, "sign": sign, "scale": scale}
            factor = {**INPUT_UNITS, **OUTPUT_UNITS[plan.motion], **REFERENCE_UNITS}[unit]
            if unit.endswith("A"):
                channel["torque_constant_nm_a"] = float(generator.uniform(0.1, 3))
                factor *= channel["torque_constant_nm_a"]
            if unit.startswith("counts"):
                spread = played.output[..., motor].std()
                channel["counts_per_turn"] = float(np.round(2 * np.pi / (1e-4 * spread)))
                channel["scale"] = scale = 1.0
                factor = 2 * np.pi / channel["counts_per_turn"]
            factors[name], units[name] = sign * scale * factor, unit
            offsets[name] = 0.0
            if group == "outputs":
                size = played.output[..., motor].std() / abs(factors[name])
                offsets[name] = float(generator.choice([0, 30]) * generator.uniform(-1, 1) * size)
                channel["zero"] = float(generator.uniform(-1, 1) * size)
            settings[group].append(channel)
    if not plan.references:
        settings["references"] = []
    return settings, factors, offsets, units


def _wrap(plan: Plan, outputs: list[dict[str, Any]], offsets: dict) -> dict[str, float]:
    """Has angles begin anew in the middle of their range; returns the turn of each, as it is logged."""
    turns = {}
    for channel in outputs:
        if channel["unit"] in TURNS:
            name, channel["unwrap"] = channel["variable"], True
            turns[name] = TURNS[channel["unit"]] / channel["scale"]
            offsets[name] = turns[name] * (0.5 + 2 * (plan.seed % 3))
    return turns


def _part(plan: Plan, drop: int, generator: np.random.Generator) -> tuple[int, int, int]:
    """First sample that is used, of all that were played, and how many the log has before and after that part."""
    any_, begin = int(generator.integers(1, N_SAMPLE)), FIRST * N_SAMPLE
    tail = int(generator.integers(0, N_SAMPLE))
    if plan.start == "anywhere":
        return begin - any_, 0, tail
    if plan.start == "before":
        return begin, any_, tail if plan.references else 0
    return begin, drop * N_SAMPLE, tail


def _signals(plan: Plan, played: Played, index: tuple[int, ...]) -> dict[str, np.ndarray]:
    """Every signal of an experiment, over all that was played, in SI units."""
    found = {}
    for motor in range(2):
        found[f"u{motor + 1}"] = played.torque[index][..., motor].ravel()
        found[f"q{motor + 1}"] = played.output[index][..., motor].ravel()
        if plan.references:
            found[f"ref{motor + 1}"] = np.tile(played.reference[index][:, motor], N_PERIOD)
    return found


def _rounded(plan: Plan, values: np.ndarray, unit: str, name: str) -> np.ndarray:
    if unit.startswith("counts"):
        return np.round(values).astype(np.int64 if plan.kind not in MESSAGES else float)
    if plan.precision == "single":
        single = values.astype(np.float32)
        return single if plan.kind not in ("csv", *MESSAGES) else single.astype(float)
    if plan.precision == "rounded" and not name.startswith("ref"):
        quantum = 10.0 ** np.floor(np.log10(3e-4 * values.std()))
        return np.round(values / quantum) * quantum
    return values


def _time(plan: Plan, lead: int, used: int, tail: int, generator: np.random.Generator) -> Any:
    """The log's own time; samples are missing before and after what is used, and whole periods inside."""
    steps = np.ones(lead + used + tail)
    if plan.gaps:
        if lead > 2:
            steps[generator.integers(1, lead)] += 7.3
        if tail > 2:
            steps[lead + used + generator.integers(1, tail)] += 2.9
        steps[lead + N_SAMPLE] += 2 * N_SAMPLE
    if plan.stamp:
        since = np.cumsum(steps) * plan.step_s - 0.75 * plan.step_s * len(steps)
        return [(MIDNIGHT + timedelta(seconds=round(float(x), 6))).strftime(STAMPS[plan.stamp]) for x in since]
    factor = {"s": 1.0, "ms": 1e3, "us": 1e6}[plan.time]
    return factor * (plan.step_s * (np.cumsum(steps) - 1) + float(generator.choice([0.0, 12.5])))


def _out_of_order(plan: Plan, columns: dict[str, Any], n_sample: int) -> dict[str, Any]:
    """Columns of which two rows stand some rows too late and two others twice, the same ones in every experiment."""
    generator = np.random.default_rng([plan.seed, 4])
    places = np.arange(float(n_sample))
    places[generator.choice(n_sample - 20, 2, replace=False)] += [1.5, 7.5]
    rows = np.argsort(places, kind="stable")
    rows = np.insert(rows, at := generator.choice(n_sample - 1, 2, replace=False), rows[at])
    return {name: [one[row] for row in rows] if isinstance(one, list) else one[rows] for name, one in columns.items()}


def _extra(plan: Plan, n_sample: int) -> dict[str, Any]:
    """Columns that the mapping does not name."""
    if plan.kind in MESSAGES:
        return {}
    generator = np.random.default_rng([plan.seed, 3])
    kept = generator.random(4) < 0.5
    every: dict[str, Any] = {
        "x_lost": np.where(np.arange(n_sample) % 7, np.nan, 1.0),
        "x_still": np.full(n_sample, 4.0),
        "x_other": generator.standard_normal(n_sample),
    }
    if plan.kind in ("csv", "parquet"):
        every["x_state"] = ["run" if i % 2 else "idle" for i in range(n_sample)]
    return {name: values for (name, values), keep in zip(every.items(), kept, strict=False) if keep}
