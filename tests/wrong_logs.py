"""What may be wrong with logs of any form, and what the message then has to say."""

import numpy as np

from any_log_files import prefix_of
from linear_loop import LINES, N_SAMPLE

WRONG = {}
"""By its name: what spoils logs, and what is fixed of their plan so that it shows.

Each returns what the message has to say; a column's name stands for its variable.
"""

COLUMNS = ("u1", "u2", "q1", "q2", "ref1", "ref2")


def wrong(**fixed):
    """Registers what spoils logs, and what is fixed of their plan."""

    def register(spoil):
        WRONG[spoil.__name__] = (spoil, fixed)
        return spoil

    return register


def chosen(logs):
    """An experiment and a channel."""
    index = list(logs.columns)[logs.plan.seed % len(logs.columns)]
    names = [name for name in logs.columns[index] if name[:-1] in ("u", "q", "ref")]
    return index, names[logs.plan.seed // 16 % len(names)]


def inside(logs, index):
    """A sample of the part that is used, not near the ends of a period."""
    at = logs.plan.seed % (N_SAMPLE - 40) + 20
    return logs.begin[index] + N_SAMPLE + at


def part_of(logs, name):
    """What the name of a channel's file begins with."""
    return "out_" if logs.plan.split and name.startswith("q") else ""


def channel_of(groups, name):
    """The settings of a channel, by its column's name."""
    return groups[{"u": "inputs", "q": "outputs", "r": "references"}[name[0]]][int(name[-1]) - 1]


@wrong(precision="full", motion="acceleration")
def lost_value(logs):
    """One value is NaN."""
    index, name = chosen(logs)
    at = inside(logs, index)
    logs.columns[index][name][at] = np.nan
    return [logs.file_name(index, part_of(logs, name)), f"sample {at}", "NaN", name]


@wrong()
def dead_channel(logs):
    """A channel was not connected."""
    index, name = chosen(logs)
    logs.columns[index][name][:] = 3
    return [logs.file_name(index, part_of(logs, name)), "D044 It is constant (3)", name]


@wrong()
def missing_variable(logs):
    """A variable has another name in the log."""
    _, name = chosen(logs)
    channel_of(logs.channels, name)["variable"] = f"{prefix_of(logs.plan)}{name}_filtered"
    return [f"{name}_filtered", "D040"]


@wrong(places="file")
def missing_file(logs):
    """A log was not recorded."""
    index, name = chosen(logs)
    logs.missing = logs.file_name(index, part_of(logs, name))
    return [logs.missing]


@wrong(places="file", estimator="logarithmic", periods=3, precision="full")
def lost_sample(logs):
    """A sample of all channels is lost, and the log has no time that tells."""
    index, _ = chosen(logs)
    at = inside(logs, index)
    columns = logs.columns[index]
    for name in columns:
        columns[name] = np.delete(np.asarray(columns[name]), at)
    if "t" in columns:
        # The gap of whole periods shows too, where the lost sample moves it away from a period's end.
        told = ["D126"] if logs.plan.gaps else ["1 gap", f"after sample {at - 1}"]
        return [logs.file_name(index), *told]
    return []


@wrong(places="file", kind="hdf5")
def shorter_channel(logs):
    """One channel ends a sample before the others."""
    index, name = chosen(logs)
    logs.columns[index][name] = logs.columns[index][name][:-1]
    return [logs.file_name(index, part_of(logs, name)), name, "D048"]


@wrong(places="file")
def too_short(logs):
    """A log ends before its last period does."""
    index, _ = chosen(logs)
    # What was played before the part that is used must not stand in for what is missing.
    enough = (logs.drop_periods + logs.plan.periods) * N_SAMPLE
    stop = min(logs.begin[index] + (logs.plan.periods - 1) * N_SAMPLE + 60, enough - 1)
    logs.columns[index] = {name: values[:stop] for name, values in logs.columns[index].items()}
    return [logs.file_name(index)]


@wrong(references=True, step_s=1e-3, n_real=2, excitation="list")
def unit_of_a_reference(logs):
    """A reference is in another unit than is said."""
    units = {"rad/s": "rpm", "rpm": "deg/s", "deg/s": "rad/s"}
    reference = logs.channels["references"][logs.plan.seed % 2]
    reference["unit"] = units[reference["unit"]]
    return ["D106", reference["name"], "unit or scale"]


@wrong()
def unknown_unit(logs):
    """An output's unit is written in another way."""
    channel = logs.channels["outputs"][logs.plan.seed % 2]
    channel["unit"] = "degrees"
    return ["log.yaml", "outputs", "unit", "'deg'"]


@wrong()
def period_off_by_a_sample(logs):
    """The period is stated one sample too long or too short."""
    sign = 1 if logs.plan.seed % 2 else -1
    logs.period_samples += sign
    return [] if logs.plan.references else ["256 samples"]


@wrong(references=False, excitation="list", start="record")
def lines_that_were_not_excited(logs):
    """The lines are said to be two higher."""
    logs.lines = (LINES + 2).tolist()
    return [logs.file_name((0, 0, 0)), "9-49 by 4"]


@wrong(time="ms", gaps=False)
def unit_of_the_time(logs):
    """The time is said to be in seconds, but is in ms."""
    for columns in logs.columns.values():
        if "t" in columns:
            columns["t"] = columns["t"] * 1000
    return ["time unit is off by a factor of 1000", "time.unit to us"]


@wrong(time="s")
def time_that_stands_still(logs):
    """The time repeats a stamp."""
    index, _ = chosen(logs)
    at = inside(logs, index)
    logs.columns[index]["t"][at] = logs.columns[index]["t"][at - 1]
    return [logs.file_name(index), "Time does not advance", f"after sample {at - 1}"]


@wrong(references=True, step_s=1e-3, n_real=2, excitation="list", places="file", split=False)
def exchanged_logs(logs):
    """Two logs have each other's names."""
    first, second = (0, 0, 0), (0, 1, 1)
    columns = logs.columns
    columns[first], columns[second] = columns[second], columns[first]
    return [logs.file_name(first), "It contains realization 2, experiment 2"]


@wrong(places="file", estimator="logarithmic")
def the_same_log_twice(logs):
    """Both experiments of a block are one."""
    index, _ = chosen(logs)
    first, second = (*index[:2], 0), (*index[:2], 1)
    logs.columns[second], logs.begin[second] = logs.columns[first], logs.begin[first]
    return []


@wrong(places="file")
def cut_file(logs):
    """A file was copied by half."""
    index, name = chosen(logs)
    logs.cut = logs.file_name(index, part_of(logs, name))
    return [logs.cut]
