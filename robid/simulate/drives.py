"""The drives between controller and motors: delays of torques and angles, each drive's own, and what encoders show."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from mujoco.batch import Batch

from robid.arrays import FloatArray
from robid.robot.model import ElasticModel
from robid.simulate.late import Late, of_each, samples_of
from robid.simulate.options import Controller, Imperfections, SimulateOptions


class Drives:
    """Brings torques to the motors and angles to the controller, of many simulations.

    A torque acts after the controller's delay, and that of a late drive after more; within a sample it changes where
    that falls. The step in which it does so has the mean torque, so that it gets the same impulse.

    Args:
        model: The elastic model.
        batch: The simulations, at rest.
        controller: Their controller.
        options: Which drives are late, what encoders show, and the steps per sample, which are settled.
        rest_torque (n_motor,) or (n_sim, n_motor): Torque at rest [N m].
    """

    def __init__(
        self,
        model: ElasticModel,
        batch: Batch,
        controller: Controller,
        options: SimulateOptions,
        rest_torque: FloatArray,
    ) -> None:
        self._batch, self._steps, self._flaws = batch, options.steps_per_sample or 1, options.imperfections
        names, period_s = [joint.name for joint in model.robot.joints], controller.sampling_period_s
        self._qpos, self._qvel, self._motor, self._turns = batch.qpos, batch.qvel, model.motor, model.turns
        self._ctrl = batch.ctrl[:, : len(names)]
        self._wait, self._part = samples_of(_lateness(options.truth.late_torque_s, names), period_s)
        self._wait += controller.delay_samples
        # Asked in every sample: whether torques change within it, and all after the same wait.
        self._splits, self._alike = bool(self._part.any()), bool((self._wait == self._wait[0]).all())
        held = np.broadcast_to(rest_torque, self._ctrl.shape).copy()
        self.sent = [held] * (int(self._wait.max()) + 1)  # (n_sim, n_motor) each, the latest first
        self._late = Late(_lateness(options.truth.late_angle_s, names), period_s)
        self.begin(self.sent)

    def begin(self, sent: list[FloatArray]) -> None:
        """Begins where the batch is, with torques (n_sim, n_motor) that were sent before, the latest first [N m]."""
        self.sent = sent
        if self._late.lags:
            self._late.begin(self._qpos[:, self._motor] * self._turns, self._qvel[:, self._motor] * self._turns)

    def read(self, noise: FloatArray) -> FloatArray:
        """Returns what the encoders show (n_sim, n_motor) at the beginning of a sample, noise (n_sim, n_motor) on it.

        Once a sample: late angles are those of samples before.
        """
        angle = self._qpos[:, self._motor] * self._turns
        if self._late.lags:
            angle = self._late.read(angle, self._qvel[:, self._motor] * self._turns)
        return encoder_readings(angle, noise, self._flaws)

    def send(self, command: FloatArray, disturbance: FloatArray) -> None:
        """Sends torques (n_sim, n_motor) at the beginning of a sample, a disturbance of what acts beside [N m]."""
        self.sent = [command.copy(), *self.sent]
        due = self.sent[int(self._wait[0])] if self._alike else of_each(self.sent, self._wait)
        self._now, self._done = due + disturbance, 0
        if self._splits:
            self._before = of_each(self.sent, self._wait + 1) + disturbance
        self.sent.pop()
        self._ctrl[:] = self._now

    def step(self, count: int) -> None:
        """Runs so many of the sample's steps."""
        if not self._splits:
            self._batch.step(nstep=count)
            return
        for _ in range(count):
            # Of this step, what the earlier torque still has.
            left = np.clip(self._part * self._steps - self._done, 0.0, 1.0)
            self._ctrl[:] = self._now + left * (self._before - self._now)
            self._batch.step(nstep=1)
            self._done += 1


def changes_within(options: SimulateOptions, controller: Controller) -> bool:
    """Tells whether a torque changes within a sample, for its drive is late by a part of one."""
    late_s = options.truth.late_torque_s
    return bool(samples_of(_lateness(late_s, list(late_s)), controller.sampling_period_s)[1].any())


def _lateness(late_s: Mapping[str, float], names: list[str]) -> FloatArray:
    """How late each drive is (n_motor,) [s]."""
    return np.array([late_s.get(name, 0.0) for name in names])


def encoder_readings(angle: FloatArray, noise: FloatArray, flaws: Imperfections) -> FloatArray:
    """Returns what the encoders show: resolver error, noise and quantisation on the true angle [rad]."""
    shown = angle + noise
    if flaws.resolver_error_rad:
        shown += flaws.resolver_error_rad * np.sin(flaws.resolver_order * angle)
    if flaws.encoder_resolution_rad:
        shown = np.round(shown / flaws.encoder_resolution_rad) * flaws.encoder_resolution_rad
    return shown
