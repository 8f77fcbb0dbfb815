"""Files of one recording that begin at different moments keep these: none is joined as if it began with the first."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from robid.errors import DataError
from robid.logs.formats.load import load_variables
from robid.logs.importing import import_log
from robid.logs.inspection.findings import inspect_log
from robid.logs.mapping import LogMapping
from robid.signals.log_channels import InputChannel, OutputChannel
from robid.signals.log_options import TimeChannel

STEP, PERIOD, PERIODS = 1e-3, 500, 6
LINES = np.arange(2, 200)
PHASES = np.random.default_rng(4).uniform(0, 2 * np.pi, (2, len(LINES)))
START = datetime(2026, 5, 4, 23, 59, 59, 700_000, tzinfo=UTC)  # so that a clock without a date passes midnight
LAG_S = 0.2
NANOSECONDS = int(START.timestamp() * 1000) * 10**6


def waves(time_s, which):
    angle = 2 * np.pi * np.outer(time_s / (PERIOD * STEP), LINES)
    return np.cos(angle + PHASES[which]).sum(axis=1)


def write_text(file, name, first, values, form):
    moments = [START + timedelta(milliseconds=first + index) for index in range(len(values))]
    lines = [f"{moment.strftime(form)},{value:.12g}" for moment, value in zip(moments, values, strict=True)]
    file.write_text("\n".join([f"t,{name}", *lines]) + "\n")
    return "t"


def write_date(file, name, first, values):
    return write_text(file, name, first, values, "%Y-%m-%dT%H:%M:%S.%f")


def write_clock(file, name, first, values):
    return write_text(file, name, first, values, "%H:%M:%S.%f")


def write_parquet(file, name, first, values):
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    moments = NANOSECONDS + 10**6 * (first + np.arange(len(values)))
    pq.write_table(pa.table({"t": pa.array(moments, pa.timestamp("ns")), name: values}), file)
    return "t"


def write_tdms(file, name, first, values):
    tdms = pytest.importorskip("nptdms")
    start = np.datetime64(NANOSECONDS + 10**6 * first, "ns").astype("datetime64[us]")
    properties = {"wf_increment": STEP, "wf_start_time": start}
    with tdms.TdmsWriter(file) as writer:
        writer.write_segment([tdms.ChannelObject("log", name, values, properties)])
    return f"log/{name}.time"


def write_mdf(file, name, first, values):
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as log:
        log.start_time = START + timedelta(milliseconds=int(first))
        log.append([asammdf.Signal(samples=values, timestamps=STEP * np.arange(len(values)), name=name)])
        log.save(file)
    return f"{name}.time"


WRITERS = {
    ("date", "csv"): write_date,
    ("clock", "csv"): write_clock,
    ("timestamps", "parquet"): write_parquet,
    ("start", "tdms"): write_tdms,
    ("start", "mf4"): write_mdf,
}


def imported(folder, kind, late, days=0):
    """The response of a log whose torque begins first, its motion so many samples later; and what it should be."""
    write, suffix = WRITERS[kind], kind[1]
    time_s = STEP * np.arange(-PERIOD, (PERIODS + 1) * PERIOD)
    files = [folder / f"{name}.{suffix}" for name in "ab"]
    firsts = (0, late) if late >= 0 else (-late, 0)
    prefix = "log/" if suffix == "tdms" else ""
    times = [
        write(file, name, first + which * days * 86_400_000, waves(time_s, which)[first:])
        for which, (file, name, first) in enumerate(zip(files, "uq", firsts, strict=True))
    ]
    mapping = LogMapping(
        file=files[0],
        files={"other": files[1]},
        sampling_period_s=STEP,
        time=TimeChannel(times[0], "s"),
        inputs=(InputChannel("motor", f"{prefix}u", "N m"),),
        outputs=(OutputChannel("motor", f"{prefix}q", file="other"),),
    )
    record = import_log(
        mapping, samples_per_period=PERIOD, periods=PERIODS - 1, excited_lines=LINES, configurations=np.zeros((1, 1))
    )
    torque, motion = (np.fft.rfft(x.reshape(-1, PERIOD).mean(axis=0))[LINES] for x in (record.inputs, record.outputs))
    return motion / torque, np.exp(1j * (PHASES[1] - PHASES[0]))


@pytest.mark.parametrize("kind", WRITERS, ids=" ".join)
@pytest.mark.parametrize("late", [0, 200, -350])
def test_files_that_begin_at_different_moments_are_joined_by_these(tmp_path, kind, late):
    found, true = imported(tmp_path, kind, late)
    np.testing.assert_allclose(found, true, atol=1e-6)


def test_files_of_different_days_are_not_joined(tmp_path):
    with pytest.raises(DataError, match="same time"):
        imported(tmp_path, ("date", "csv"), 0, days=1)


def test_a_missing_first_moment_is_the_only_one_that_is_missing(tmp_path):
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    moments = [None, *(NANOSECONDS + 10**6 * np.arange(1, 5)).tolist()]
    pq.write_table(pa.table({"t": pa.array(moments, pa.timestamp("ns"))}), tmp_path / "log.parquet")
    time = load_variables(tmp_path / "log.parquet")["t"]
    np.testing.assert_allclose(time, [np.nan, 0.0, 1e-3, 2e-3, 3e-3], atol=1e-12)


@pytest.mark.parametrize("form", [None, "%Y-%m-%dT%H:%M:%S.%f"])
@pytest.mark.parametrize("proposed", [False, True])
def test_a_log_that_was_written_newest_first_is_put_in_the_order_of_time(tmp_path, form, proposed):
    time_s = STEP * np.arange(PERIODS * PERIOD)
    torque, motion = waves(time_s, 0), waves(time_s, 1)
    stamps = [f"{time:.3f}" if form is None else (START + timedelta(seconds=time)).strftime(form) for time in time_s]
    rows = [f"{at},{u:.12g},{q:.12g}" for at, u, q in zip(stamps, torque, motion, strict=True)]
    file = tmp_path / "log.csv"
    file.write_text("\n".join(["time [s],torque [N m],angle [rad]", *rows[::-1]]) + "\n")
    time = "time [s]"
    if proposed:
        found = inspect_log([file])
        assert found.sampling.step_s == pytest.approx(STEP)
        time = found.sampling.variable
    mapping = LogMapping(
        file=file,
        sampling_period_s=STEP,
        time=TimeChannel(time, "s"),
        inputs=(InputChannel("motor", "torque [N m]", "N m"),),
        outputs=(OutputChannel("motor", "angle [rad]"),),
    )
    record = import_log(
        mapping, samples_per_period=PERIOD, periods=PERIODS, excited_lines=LINES, configurations=np.zeros((1, 1))
    )
    np.testing.assert_allclose(record.inputs.ravel(), torque, atol=1e-9)
    assert any("newest first" in note for note in record.notes)
