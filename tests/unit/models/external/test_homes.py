"""A fit of one home position reads its records there, and is validated there."""

import numpy as np
import pytest

from robid.errors import DataError
from robid.models.external.fit.data import commands_of, shots_of
from robid.models.external.fit.fitting import ports_of
from robid.models.external.fit.options import CouplingOptions, ExternalOptions
from robid.models.external.fitting import at_homes, homes_of, refuse_other_ports, selected
from robid.signals.quantities import Channel
from robid.signals.record import Record

HOMES = np.array([[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]])


def record_at(homes, unit="m"):
    told = np.random.default_rng(1).standard_normal((len(homes), 1, 1, 1, 50, 1))
    return Record(
        sampling_period_s=0.01,
        inputs=told,
        outputs=told,
        output_offset=np.zeros((len(homes), 1)),
        input_channels=(Channel("X", "position_command", unit, "tool"),),
        output_channels=(Channel("X", "position", unit, "tool"),),
        configurations=homes,
    )


def test_configurations_are_counted_on_from_record_to_record():
    records = record_at(HOMES[:2]), record_at(HOMES)
    first, second = selected(records, (1, 3))
    np.testing.assert_array_equal(first.configurations, HOMES[1:2])
    np.testing.assert_array_equal(second.inputs, records[1].inputs[1:2])
    assert selected(records, (4,))[0] is None
    assert selected(records, ()) == records
    np.testing.assert_array_equal(homes_of(selected(records, (1, 3))), HOMES[1:2])
    np.testing.assert_array_equal(homes_of(records), HOMES)


def test_a_validation_is_read_where_the_fit_was_if_it_was_there():
    record = record_at(HOMES)
    np.testing.assert_array_equal(at_homes(record, HOMES[1:2] + 1e-9).configurations, HOMES[1:2])
    assert at_homes(record, np.array([[2.0, 2.0]])) is record
    assert at_homes(record, np.zeros((0, 0))) is record


def test_other_channels_and_units_are_refused():
    record, options = record_at(HOMES), ExternalOptions()
    shots = shots_of(record, options, "slow")
    told = commands_of(record, options)
    ports = ports_of(shots, told.channels, record.output_channels, told.hold, CouplingOptions())
    refuse_other_ports(ports, record, options)
    for other in (record_at(HOMES, "rad"), record):
        hold = options if other is not record else ExternalOptions(hold="foh")
        with pytest.raises(DataError, match="the validation has"):
            refuse_other_ports(ports, other, hold)
