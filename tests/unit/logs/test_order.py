"""Single rows that stand out of order or twice are put in their place; anything else is left to who knows the log."""

import numpy as np
import pytest

from robid.errors import DataError
from robid.logs.importing import import_shot
from robid.logs.inspection.findings import inspect_log
from robid.logs.mapping import LogMapping
from robid.logs.order import rows_in_order
from robid.signals.log_channels import InputChannel, OutputChannel
from robid.signals.log_options import TimeChannel

STEP, COUNT = 1e-3, 2000
TIME = STEP * np.arange(COUNT)
VALUES = np.random.default_rng(1).standard_normal((2, COUNT))


def late(rows, by=1.5):
    """An order in which some rows come later than they should."""
    places = np.arange(float(COUNT))
    places[rows] += by
    return np.argsort(places, kind="stable")


REPEATED = np.sort(np.concatenate([np.arange(COUNT), [300, 300, 1201]]))


@pytest.mark.parametrize("order", [late([100, 700, 701]), late([40], 30.5), REPEATED])
@pytest.mark.parametrize("stamps", [TIME, (1e9 * TIME).astype(np.uint64) + np.uint64(1_700_000_000_000_000_000)])
def test_single_rows_are_put_in_their_place_once(order, stamps):
    rows = rows_in_order(stamps[order], list(VALUES[:, order]))
    np.testing.assert_array_equal(order[rows], np.arange(COUNT))


@pytest.mark.parametrize(
    ("stamps", "values"),
    [
        (TIME, VALUES),  # in order
        (np.round(TIME, 2), VALUES),  # rounded
        (np.concatenate([TIME[:1000], TIME[:1000]]), VALUES),  # two recordings
        (TIME[REPEATED], VALUES[:, np.clip(np.arange(len(REPEATED)), 0, COUNT - 1)]),  # the same time, other values
        (TIME[::-1], VALUES),
        (np.full(COUNT, np.nan), VALUES),
        (TIME[np.random.default_rng(2).permutation(COUNT)], VALUES),
    ],
)
def test_nothing_else_is_touched(stamps, values):
    assert rows_in_order(stamps, list(values)) is None


@pytest.mark.parametrize("order", [late([100, 700, 701]), REPEATED])
def test_a_log_of_such_rows_is_read_and_inspected_as_that_without(tmp_path, order):
    motion = np.sin(20 * TIME)
    table = np.stack([TIME, VALUES[0], motion], axis=1)[order]
    file = tmp_path / "log.csv"
    np.savetxt(file, table, fmt="%.12g", delimiter=",", header="t [s],tau [Nm],q [rad]", comments="")
    record = import_shot(
        LogMapping(
            file=file,
            sampling_period_s=STEP,
            time=TimeChannel("t [s]", "s"),
            inputs=(InputChannel("motor", "tau [Nm]", "N m"),),
            outputs=(OutputChannel("motor", "q [rad]"),),
            one_shot=True,
        )
    )
    np.testing.assert_allclose(record.inputs.ravel(), VALUES[0], atol=1e-9)
    np.testing.assert_allclose(record.outputs.ravel() + record.output_offset.ravel(), motion, atol=1e-9)
    assert any("was put in its place once" in note for note in record.notes)
    found = inspect_log([file])
    assert (found.n_sample, found.sampling.gaps, found.sampling.backward) == (COUNT, 0, 0)


def test_rows_of_one_time_with_other_values_are_refused(tmp_path):
    table = np.stack([TIME[REPEATED], np.arange(len(REPEATED)) % 7.3, np.arange(len(REPEATED)) % 5.1], axis=1)
    np.savetxt(tmp_path / "log.csv", table, fmt="%.12g", delimiter=",", header="t,u,q", comments="")
    mapping = LogMapping(
        file=tmp_path / "log.csv",
        sampling_period_s=STEP,
        time=TimeChannel("t", "s"),
        inputs=(InputChannel("motor", "u", "N m"),),
        outputs=(OutputChannel("motor", "q"),),
        one_shot=True,
    )
    with pytest.raises(DataError, match="D122"):
        import_shot(mapping)
