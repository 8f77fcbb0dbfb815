"""Records as shots: averaging, its noise, starts, offsets and integrated speeds."""

from dataclasses import replace

import numpy as np
import pytest

from robid.errors import DataError
from robid.models.external.fit.checks import blocks_of
from robid.models.external.fit.data import commands_of, shots_of
from robid.models.external.fit.options import ExternalOptions
from robid.signals.quantities import Channel, motor_channels
from robid.signals.record import Record
from tolerances import IDENTITY

PERIOD_S, N_SAMPLE = 0.012, 400


def record_of(inputs, outputs, **other):
    return Record(
        sampling_period_s=PERIOD_S,
        inputs=inputs,
        outputs=outputs,
        output_offset=np.full((inputs.shape[0], outputs.shape[-1]), 2.0),
        input_channels=tuple(Channel(name, "position_command", "m", "tool") for name in "XYZ"[: inputs.shape[-1]]),
        output_channels=tuple(Channel(name, "position", "m", "tool") for name in "XYZ"[: outputs.shape[-1]]),
        **other,
    )


def waves(*shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


def test_the_deviation_of_the_mean_is_that_of_the_scatter():
    told = np.tile(waves(1, 1, 1, 1, N_SAMPLE, 1), (1, 4, 1, 1, 1, 1))
    noise = 0.3 * waves(200, 4, 1, 1, N_SAMPLE, 1, seed=1)
    found = [shots_of(record_of(told, told + each[None]), ExternalOptions(), "fit")[0] for each in noise]
    spread = np.std([shot.outputs - told[0, 0, 0, 0] for shot in found], ddof=0)
    predicted = np.array([shot.noise_std[0] for shot in found])
    assert {shot.repeats for shot in found} == {4}
    # The mean of 200 deviations, each of 1200 values.
    assert np.sqrt(np.mean(predicted**2)) == pytest.approx(spread, rel=0.01)


def test_periods_that_lie_apart_by_more_than_noise_wander():
    told = np.tile(waves(1, 1, 1, 1, N_SAMPLE, 1), (1, 2, 1, 4, 1, 1))
    noise = 0.3 * waves(*told.shape, seed=1)
    drift = 0.1 * np.arange(4)[:, None, None]
    logs = 5.0 * np.arange(2)[:, None, None, None, None]
    steady, drifting = (
        shots_of(record_of(told, told + noise + logs + more), ExternalOptions(), "fit")[0] for more in (0.0, drift)
    )
    assert steady.wander == 0.0, "noise is none, nor are levels of logs of their own"
    assert drifting.wander == pytest.approx(0.1 * np.std(np.arange(4), ddof=1), rel=0.05)
    single = shots_of(record_of(told[:, :, :, :1], told[:, :, :, :1]), ExternalOptions(), "fit")[0]
    assert single.wander is None
    record = record_of(told, told + drift)
    speeds = replace(record, input_channels=(Channel("X", "speed_reference", "m/s", "tool"),))
    assert shots_of(speeds, ExternalOptions(), "fit")[0].wander is None, "no loop holds its position"


def test_realizations_with_other_commands_are_shots_of_their_own():
    told = waves(1, 3, 2, 1, N_SAMPLE, 1)
    told[0, 2] = told[0, 0]
    shots = shots_of(record_of(told, 0.5 * told), ExternalOptions(), "fit")
    assert [shot.repeats for shot in shots] == [2, 1, 2, 1]
    assert shots[0].name == "fit, realization 1, experiment 1"
    assert shots[1].noise_std is None
    for shot in shots:
        np.testing.assert_allclose(shot.outputs - shot.outputs[0], 0.5 * shot.inputs, atol=1e-12)


def test_start_and_offset_follow_the_record_and_the_options():
    told = waves(1, 1, 1, 2, N_SAMPLE, 1)
    one_shot, periodic = record_of(told, told), record_of(told, told, excited_lines=np.array([1, 3]))
    assert [shots_of(each, ExternalOptions(), "fit")[0].start for each in (one_shot, periodic)] == ["free", "periodic"]
    rest = shots_of(one_shot, ExternalOptions(start="rest", offset="none"), "fit")[0]
    assert (rest.start, rest.offset) == ("rest", False)
    np.testing.assert_allclose(rest.outputs, told[0, 0, 0].mean(axis=0) + 2.0, rtol=IDENTITY)
    np.testing.assert_allclose(rest.inputs, told[0, 0, 0].mean(axis=0), rtol=IDENTITY)
    assert shots_of(periodic, ExternalOptions(), "fit")[0].inputs.mean() == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_integrated_speeds_are_positions(hold):
    time = PERIOD_S * np.arange(N_SAMPLE)
    omega = 2 * np.pi * 3 / (N_SAMPLE * PERIOD_S)
    speed = (omega * np.cos(omega * time))[None, None, None, None, :, None]
    record = replace(
        record_of(speed, np.sin(omega * time)[None, None, None, None, :, None], excited_lines=np.array([3])),
        input_channels=(Channel("X", "speed_reference", "m/s"),),
    )
    told = commands_of(record, ExternalOptions(hold=hold))
    assert (told.channels[0].quantity, told.channels[0].unit, told.hold) == ("position_command", "m", "foh")
    # Held for a sample the speed comes half a sample late.
    late = 0.5 * PERIOD_S if hold == "zoh" else 0.0
    expected = np.sin(omega * (time - late)) + np.sin(omega * late)
    np.testing.assert_allclose(told.values[0, 0, 0, 0, :, 0], expected, atol=(omega * PERIOD_S) ** 2)
    assert commands_of(record, ExternalOptions(speed_references="kept")).hold == "zoh"


def test_channels_are_those_of_the_same_name():
    inputs = motor_channels(("turn", "lift"), "position_command")
    outputs = (
        Channel("turn.arm", "angle", "rad", "arm"),
        *motor_channels(("turn",), "angle"),
        Channel("lift.arm", "angle", "rad", "arm"),
    )
    names = [(block.name, block.inputs, block.outputs) for block in blocks_of(inputs, outputs, ExternalOptions())]
    assert names == [("turn", (0,), (1,)), ("lift.arm", (1,), (2,))]
    single = blocks_of(inputs[:1], outputs, ExternalOptions())
    assert [block.name for block in single] == ["turn.arm", "turn", "lift.arm"]
    crossed = blocks_of(inputs, outputs, ExternalOptions(pairs=(("turn", "lift.arm"), ("lift", "lift.arm"))))
    assert [block.name for block in crossed] == ["lift.arm/turn", "lift.arm"]
    whole = blocks_of(inputs, outputs, ExternalOptions(matrix="full"))
    assert [(block.name, block.inputs, block.outputs) for block in whole] == [("matrix", (0, 1), (1, 2))]
    with pytest.raises(DataError, match="no output `turm`"):
        blocks_of(inputs, outputs, ExternalOptions(pairs=(("turn", "turm"),)))
