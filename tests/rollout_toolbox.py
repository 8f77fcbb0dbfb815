"""Springs and dampers identified by MuJoCo's own toolbox, from rollouts of a simulated record."""

import contextlib
import io

import mujoco
import numpy as np
from mujoco import rollout, sysid

from robid.robot.linearize import solve_statics
from robid.robot.model import build_model

STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS
WINDOW = 250
FACTOR = 3.0
AVAILABLE = hasattr(sysid, "optimize")


class _Done(Exception):  # noqa: N818
    """Ends the toolbox's optimizer from within its callback."""


def windows_of(record, robot, configuration, delay_s):
    """Initial states, applied torques and angles of windows in the last period of the first block of experiments.

    The true robot replays the recorded torque from rest, which gives its full state, exact but for rounding.
    """
    model, n_motor = build_model(robot), record.inputs.shape[-1]
    rest = solve_statics(model, configuration[None])
    played = record.inputs[0, 0].reshape(record.inputs.shape[2], -1, n_motor)
    angle = record.outputs[0, 0].reshape(played.shape) + record.output_offset[0]
    late = round(delay_s / record.sampling_period_s)
    before = np.broadcast_to(rest.motor_torque[0], (len(played), late, n_motor))
    torque = np.concatenate([before, played], axis=1)[:, : played.shape[1]]
    data = mujoco.MjData(model.mujoco)
    data.qpos[:], data.ctrl[:] = rest.position[0], rest.motor_torque[0]
    state = np.empty(mujoco.mj_stateSize(model.mujoco, STATE))
    mujoco.mj_getState(model.mujoco, data, state, STATE)
    states = rollout.rollout(model.mujoco, [data], np.tile(state, (len(torque), 1)), torque)[0]
    assert np.abs(states[:, :-1, 1 + model.motor] - angle[:, 1:]).max() < 1e-4, "the replay must be the record"
    states[:, :, 0] = 0.0
    n_sample = torque.shape[1]
    begins = range(n_sample - record.inputs.shape[4], n_sample - WINDOW, WINDOW)
    each = [(row, slice(begin, begin + WINDOW + 1)) for row in range(len(torque)) for begin in begins]
    starts = [states[row, part.start - 1] for row, part in each]
    return starts, [torque[row, part] for row, part in each], [angle[row, part] for row, part in each]


def make_sequences(record, nominal, windows):
    """The toolbox's windows as one list, so that it builds each model once."""
    model = build_model(nominal)
    for joint in nominal.joints:
        model.spec.add_sensor(
            name=joint.name,
            type=mujoco.mjtSensor.mjSENS_JOINTPOS,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            objname=f"q_m_{joint.name}",
        )
    starts, torques, angles = windows
    times = record.sampling_period_s * np.arange(WINDOW + 1)
    series = [[sysid.TimeSeries(times, values) for values in each] for each in (torques, angles)]
    names = [str(index) for index in range(len(starts))]
    sequences = sysid.ModelSequences("robot", model.spec, names, starts, *series)
    sequences.measured_rollout = [sequences.measured_rollout]
    return sequences


def make_parameters(nominal):
    """Logarithms of factors on springs and dampers, which scale them alike."""
    parameters, reach = sysid.ParameterDict(), np.log(FACTOR)
    for spring in nominal.springs:
        for kind, value in (("stiffness", spring.stiffness), ("damping", spring.damping)):

            def scale(spec, parameter, name=spring.name, kind=kind, value=value):
                element = spec.tendon(name) or spec.joint(f"q_e_{name}")
                coefficients = getattr(element, kind).copy()
                coefficients[0] = value * np.exp(parameter.value[0])
                setattr(element, kind, coefficients)

            parameters.add(sysid.Parameter(f"{spring.name}.{kind}", 0.0, -reach, reach, modifier=scale))
    return parameters


def identify_by_rollouts(record, robot, nominal, configuration, delay_s, stop):
    """Runs the toolbox until it ends or `stop(spring factors)` says so after an iteration."""
    windows = windows_of(record, robot, configuration, delay_s)
    sequences, motor = make_sequences(record, nominal, windows), 1 + build_model(nominal).motor
    noise, n_window = 1e-5, len(windows[0])

    def error(_parameters, _predicted, measured, _model, _everything, state):
        return (state[:, motor] - measured.data[1:]) / noise, measured, measured

    by_window = sysid.build_residual_fn(
        models_sequences=[sequences], modify_residual=error, resample_true=False, n_threads=1
    )

    def residual(point, parameters):
        """Windows one below the other, one column for each point; the toolbox puts windows into columns too."""
        columns = 1 if point.ndim == 1 else point.shape[1]
        try:
            found = by_window(point, parameters)[0][0]
        except ValueError:  # a rollout blew up, and its clock with it
            return [np.full((n_window * WINDOW * motor.size, columns), 1e6)], None, None
        return [found.reshape(-1, columns, n_window).swapaxes(1, 2).reshape(-1, columns)], None, None

    def told(log):
        if stop(np.exp(np.ravel(log[-1].candidate)[::2])):
            raise _Done

    parameters = make_parameters(nominal)
    with contextlib.suppress(_Done):
        sysid.optimize(parameters, residual, verbose=False, x_scale="jac", iter_callback=told, output=io.StringIO())
