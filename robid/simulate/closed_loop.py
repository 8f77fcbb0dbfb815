"""Many simulations of one closed loop, sample by sample: what it is told, its state, its signals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mujoco.batch import Batch

from robid.arrays import FloatArray
from robid.robot.linearize import Equilibrium
from robid.robot.model import ElasticModel
from robid.simulate.controller import Cascade, angle_reference
from robid.simulate.drives import Drives
from robid.simulate.engine import Followers
from robid.simulate.options import Controller, SimulateOptions
from robid.simulate.outputs import FurtherOutputs


@dataclass(frozen=True)
class Told:
    """What one period tells the loops of many simulations, each (n_sample, n_sim, n_motor)."""

    speed: FloatArray  # References of speed [rad/s]
    angle: FloatArray  # References of angle, from rest [rad]
    torque: FloatArray  # Torque beside the controller's [N m]

    @classmethod
    def excitation(cls, reference: FloatArray, inject: str, sampling_period_s: float) -> Told:
        """Returns what a period (n_sim, n_sample, n_motor) of an excitation tells that enters as `inject` says."""
        told = np.ascontiguousarray(reference.transpose(1, 0, 2))
        nothing = np.zeros_like(told)
        if inject == "speed_reference":
            return cls(
                told, np.ascontiguousarray(angle_reference(reference, sampling_period_s).transpose(1, 0, 2)), nothing
            )
        return cls(nothing, told, nothing) if inject == "position_reference" else cls(nothing, nothing, told)


class ClosedLoop:
    """Simulations of one robot at rest in one configuration, whose loops are closed.

    Args:
        model: The elastic model, built with sensors where `names` has any.
        rest: Where it rests.
        controller: Its controller.
        options: What is not linear or not exact; the steps per sample are settled.
        told: What the loops are told.
        names: Outputs after the motors: `<joint>.arm` and sensors.
        threads: Simulation threads; the result does not depend on them.
    """

    def __init__(
        self,
        model: ElasticModel,
        rest: Equilibrium,
        controller: Controller,
        options: SimulateOptions,
        told: Told,
        names: tuple[str, ...] = (),
        threads: int = 1,
    ) -> None:
        n_sim = told.speed.shape[1]
        self.batch = batch = Batch(model.mujoco, n_sim, nthread=threads)
        batch.qpos[:] = rest.position
        flaws = options.imperfections
        self._flaws, self._steps, self._names = flaws, options.steps_per_sample or 1, names
        self._position, self._held = rest.position[0], rest.motor_torque[0]
        self._motor, self._turns = model.motor, model.turns
        self._further = FurtherOutputs(model, batch, names, flaws, controller.sampling_period_s)
        self._followers = Followers(model, batch, controller, flaws)
        self._followers.follow()
        batch.ctrl[:, : model.motor.size] = self._held
        batch.forward()
        self.rest_outputs = self._further.read()[0]
        self._sensor_noise = self._further.noise_std(flaws)
        resolution = self._further.resolution(flaws)
        self._stepped, self._step = np.flatnonzero(resolution), resolution[resolution > 0]
        self._rest = model.motor_angles(batch.qpos)
        self.told, self._angle = told, self._rest + told.angle
        joints = model.robot.joints
        self._cascade = Cascade(
            controller,
            model.robot.motor_inertia_kgm2,
            np.array([joint.motor.max_torque_nm for joint in joints]),
            self._rest,
            self._held,
        )
        self._drives = Drives(model, batch, controller, options, self._held)

    @property
    def motor_angle(self) -> FloatArray:
        """The motors' true angles (n_sim, n_motor) from rest [rad]."""
        return np.asarray(self.batch.qpos[:, self._motor] * self._turns - self._rest)

    @property
    def state(self) -> FloatArray:
        """How far all are from rest (n_sim, n_state): positions and speeds, the controller's states, torques sent."""
        batch, drives = self.batch, self._drives
        angle, integral = self._cascade.last - self._rest, self._cascade.integral - self._held
        sent = [torque - self._held for torque in drives.sent]
        return np.concatenate([batch.qpos - self._position, batch.qvel, angle, integral, *sent], axis=1)

    def begin(self, state: FloatArray) -> None:
        """Brings all to a state, see `state`."""
        count, n_motor = self._position.size, self._motor.size
        ends = np.cumsum([count, count, *[n_motor] * (2 + len(self._drives.sent))])[:-1]
        position, speed, angle, integral, *sent = np.split(state, ends, axis=1)
        self.batch.qpos[:], self.batch.qvel[:] = self._position + position, speed
        self._cascade.last[:], self._cascade.integral[:] = self._rest + angle, self._held + integral
        self._drives.begin([self._held + torque for torque in sent])
        self._further.begin()
        self._followers.begin()

    def play(self, torque: FloatArray, angle: FloatArray, generator: np.random.Generator, begin: int = 0) -> None:
        """Runs some samples of the period into the given arrays (n_sample, n_sim, n_channel).

        Args:
            torque: Receives the commanded torques [N m].
            angle: Receives the encoders' angles [rad] and the further outputs.
            generator: Of the noise.
            begin: Sample of the period to begin at.
        """
        flaws, drives, told = self._flaws, self._drives, self.told
        noise = generator.standard_normal(torque.shape) * flaws.encoder_noise_rad
        disturbance = generator.standard_normal(torque.shape) * flaws.torque_noise_nm
        further = generator.standard_normal((*torque.shape[:2], len(self._names))) * self._sensor_noise
        for row in range(torque.shape[0]):
            sample = begin + row
            measured = drives.read(noise[row])
            command = self._cascade.command(measured, self._angle[sample], told.speed[sample])
            command = command + told.torque[sample]
            angle[row, :, : self._motor.size], torque[row] = measured, command
            drives.send(command, disturbance[row])
            self._followers.follow()
            if not self._names:
                drives.step(self._steps)
                continue
            arms = self._further.arms()
            drives.step(1)  # sensors show the state at its beginning
            shown = self._further.read(arms) + further[row]
            if self._stepped.size:
                shown[:, self._stepped] = np.rint(shown[:, self._stepped] / self._step) * self._step
            angle[row, :, self._motor.size :] = shown
            if self._steps > 1:
                drives.step(self._steps - 1)
