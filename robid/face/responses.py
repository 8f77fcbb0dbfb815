"""Records and frequency responses from arrays in memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from robid.arrays import LARGEST, FloatArray, IntArray
from robid.errors import DataError
from robid.face.arguments import check_axes, numbers, required, shaped, wrong_shape
from robid.face.remedies import in_words_of_python
from robid.face.robots import RobotModel
from robid.frf.estimate import estimate_frf as estimate_one
from robid.frf.joined import join
from robid.frf.options import EstimateOptions
from robid.results.options import options_from
from robid.signals.quantities import QUANTITIES, Channel, QuantityName
from robid.signals.record import Record

if TYPE_CHECKING:
    from robid.frf.frf import Frf

_AXES = "configuration, realization, experiment, period, sample, channel"
_ON_LINE = 1e-6  # of a line


def make_record(
    inputs: FloatArray,
    outputs: FloatArray,
    sampling_period_s: float,
    *,
    frequency_hz: FloatArray | None = None,
    configurations: FloatArray | None = None,
    names: Sequence[str] | None = None,
    input_quantity: QuantityName = "torque",
    output_quantity: QuantityName = "angle",
    linear: bool = False,
    held: bool = True,
) -> Record:
    """Makes a record of arrays: sampled inputs and outputs of motors, in SI units.

    Args:
        inputs (n_conf, n_real, n_exp, n_period, n_sample, n_in): Inputs, as motor torques [N m]; leading axes of
            length one may be left out.
        outputs (n_conf, n_real, n_exp, n_period, n_sample, n_out): Outputs, as motor angles [rad]; likewise.
        sampling_period_s: Sampling period [s].
        frequency_hz (n_freq,): Excited frequencies, each a line of one period [Hz]; None for motions that do not
            repeat, which rigid and external fits read.
        configurations (n_conf, n_joint): Arm-side joint positions about which the robot moved [rad, or m]; zeros when
            there are frequencies and nothing is given.
        names: Names of the inputs, and of the outputs of the same motors; `motor_1`, ... when not given.
        input_quantity: What the inputs are, as `torque` or `current`.
        output_quantity: What the outputs are, as `angle` or `speed`.
        linear: Whether outputs are those of translations [m] in place of rotations.
        held: Whether the inputs are commands held for a sample; else they were measured like the outputs.

    Raises:
        SettingsError: If an array is not numbers, or has other axes.
        DataError: If shapes or frequencies do not belong together.
    """
    u, y = _six(inputs, "inputs"), _six(outputs, "outputs")
    if u.shape[:5] != y.shape[:5]:
        what = f"D294 inputs have axes {u.shape[:5]}, outputs {y.shape[:5]}: all but the last must agree"
        raise DataError(what, where="make_record", remedy=f"bring both to ({_AXES})")
    lines = np.zeros(0, int) if frequency_hz is None else _lines(frequency_hz, u.shape[4], sampling_period_s)
    if configurations is not None:
        configurations = shaped(configurations, "configurations", "n_conf n_joint", "make_record")
    elif len(lines):
        configurations = np.zeros((len(u), u.shape[5]))
    if configurations is not None and len(configurations) != len(u):
        what = f"D295 there are {len(configurations)} configurations of joints, and signals of {len(u)}"
        raise DataError(what, where="make_record", remedy="give one row for each")
    offset = y.mean(axis=(1, 2, 3, 4)) if len(lines) else np.zeros((len(y), y.shape[5]))
    return Record(
        sampling_period_s=float(sampling_period_s),
        inputs=u,
        outputs=y - offset[:, None, None, None, None],
        output_offset=offset,
        input_channels=_channels(names, u.shape[5], input_quantity, 0),
        output_channels=_channels(names, y.shape[5], output_quantity, int(linear)),
        configurations=configurations,
        excited_lines=lines,
        input_hold="zoh" if held else "band_limited",
    )


def estimate_frf(record: Record, *, robot: RobotModel | None = None, **options: Any) -> Frf:  # noqa: ANN401
    """Estimates the frequency responses of a record, with noise and total covariance.

    Args:
        record: A record with excited frequencies, see `make_record`; any number of configurations.
        robot: The robot whose friction and ripple are subtracted from the torques; nothing is when not given.
        options: Fields of `EstimateOptions`, as `estimator` or `pooled_lines`.

    Raises:
        SettingsError: If `record` or `robot` is something else, or an array of the record has other axes.
        DataError: If the record cannot be used, or says nothing of an input.

    Source:
        Wernholt and Moberg (2008), eq. 2; docs/methods, sec. 4.
    """
    record = required(record, Record, "record", "estimate_frf", "robid.make_record(...)")
    if robot is not None:
        robot = required(robot, RobotModel, "robot", "estimate_frf", "robid.load_robot(path)")
    check_axes(record, "estimate_frf")
    options.setdefault("compensation", "none" if robot is None else "nominal")
    chosen = options_from(EstimateOptions, options, "estimate_frf")
    laws = None if robot is None else tuple(joint.motor.torque_law for joint in robot.description.joints)
    delay = 0.0 if robot is None else robot.delay_s
    rows = [_row(record, index) for index in range(len(record.inputs))]
    with in_words_of_python():
        found = [estimate_one(row, chosen, laws, delay) for row in rows]
    return found[0] if len(found) == 1 else join(found, [f"configuration {at}" for at in range(1, len(found) + 1)])


def _row(record: Record, index: int) -> Record:
    return replace(
        record,
        inputs=record.inputs[index : index + 1],
        outputs=record.outputs[index : index + 1],
        output_offset=record.output_offset[index : index + 1],
        configurations=None if record.configurations is None else record.configurations[index : index + 1],
        reference=None if record.reference is None else record.reference[index : index + 1],
    )


def _six(values: FloatArray, name: str) -> FloatArray:
    array = numbers(values, name, "make_record", _AXES)
    wrong = ~(np.abs(array) < LARGEST)
    if wrong.any():
        at = tuple(int(index) for index in np.argwhere(wrong)[0])
        what = f"D501 `{name}` has values that are not finite or beyond {LARGEST:g}, the first at index {at}"
        raise DataError(what, where="make_record", remedy="leave out the periods or realizations that have them")
    if not 2 <= array.ndim <= 6:
        what = f"D296 `{name}` has {array.ndim} axes: from (sample, channel) to ({_AXES}) are meant"
        raise DataError(what, where="make_record", remedy="one channel is an array (n_sample, 1)")
    n_sample, n_channel = array.shape[-2:]
    if n_channel > n_sample:
        what = f"`{name}` of shape {array.shape} has {n_channel} channels of {n_sample} samples: channels come last"
        raise wrong_shape(what, "make_record", f"bring its axes into the order ({_AXES})")
    return array.reshape((1,) * (6 - array.ndim) + array.shape)


def _lines(frequency_hz: FloatArray, n_sample: int, sampling_period_s: float) -> IntArray:
    """DFT lines (n_freq,) of frequencies, of a period of so many samples."""
    period_s = n_sample * sampling_period_s
    exact = shaped(frequency_hz, "frequency_hz", "n_freq", "make_record") * period_s
    lines = np.rint(exact).astype(int)
    if (np.abs(exact - lines) > _ON_LINE * np.maximum(lines, 1)).any() or (lines < 1).any():
        what = f"D297 not all frequencies are lines of a period of {period_s:g} s"
        raise DataError(what, where="make_record", remedy=f"give multiples of {1 / period_s:g} Hz")
    if lines.max(initial=0) > (n_sample - 1) // 2:
        what = f"D502 not all frequencies lie below half the sampling rate, {0.5 / sampling_period_s:g} Hz"
        raise DataError(what, where="make_record", remedy="give `sampling_period_s` in seconds and frequencies in Hz")
    return np.unique(lines)


def _channels(names: Sequence[str] | None, count: int, quantity: QuantityName, unit: int) -> tuple[Channel, ...]:
    known = [f"motor_{number}" for number in range(1, count + 1)] if names is None else list(names)
    if len(known) != count:
        what = f"D298 there are {len(known)} names for {count} channels of {quantity}"
        raise DataError(what, where="make_record", remedy="give one name for each motor")
    if quantity not in QUANTITIES:
        what = f"D503 there is no quantity `{quantity}`"
        raise DataError(what, where="make_record", remedy=f"it is {', '.join(QUANTITIES)}, in SI units")
    units = QUANTITIES[quantity].units
    return tuple(Channel(name, quantity, units[min(unit, len(units) - 1)]) for name in known)
