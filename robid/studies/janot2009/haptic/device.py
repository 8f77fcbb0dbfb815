"""The one-axis haptic device of the paper in closed loop, many at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray

GRAVITY = 9.81
NAMES = ("ZZ1", "MX1", "MY1", "fv1", "fc1")
NOMINAL = (1.45e-3, 2.40e-3, 1.00e-3, 1.50e-3, 67.0e-3)
"""Parameters of the paper's Table 1, in the order of `NAMES`; MY1 as identified there [SI]."""


@dataclass(frozen=True)
class Bench:
    """The device's loop and sensors.

    Attributes:
        sampling_period_s: Period of the controller and of the record [s].
        duration_s: Length of the record [s].
        loop_hz: Natural frequency of the position loop [Hz].
        damping: Its damping ratio.
        inertia_kgm2: Inertia that the loop was tuned for [kg m^2].
        quantum_rad: Encoder quantum [rad].
        torque_noise_nm: Standard deviation of the measured torque's white noise [N m].
        substeps: Integration steps per sampling period.
    """

    sampling_period_s: float = 240e-6
    duration_s: float = 10.0
    loop_hz: float = 20.0
    damping: float = 0.7
    inertia_kgm2: float = 1.45e-3
    quantum_rad: float = 2 * np.pi / 8192
    torque_noise_nm: float = 0.09
    substeps: int = 2

    @property
    def gains(self) -> tuple[float, float]:
        """Gains on position and speed [N m/rad, N m s/rad]."""
        rate = 2 * np.pi * self.loop_hz
        return self.inertia_kgm2 * rate**2, 2 * self.damping * rate * self.inertia_kgm2


class Device:
    """The device's inverse dynamics, eq. 20."""

    names = NAMES
    kinds = ("inertia", "first_moment", "first_moment", "viscous", "coulomb")
    units = ("kg m^2", "kg m", "kg m", "N m s/rad", "N m")

    def columns(
        self,
        position: FloatArray,
        velocity: FloatArray,
        acceleration: FloatArray,
        *,
        torque: FloatArray | None = None,  # noqa: ARG002
        friction_speed: FloatArray | None = None,
        loaded: bool = True,  # noqa: ARG002
    ) -> FloatArray:
        """Returns one column a parameter (n_sample, 1, 5)."""
        sign = np.sign(velocity if friction_speed is None else friction_speed)
        gravity = (-GRAVITY * np.cos(position), GRAVITY * np.sin(position))
        return np.stack([acceleration, *gravity, velocity, sign], axis=-1)


def reference(time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns position and speed that the device is told to follow [rad, rad/s]."""
    position, speed = np.zeros_like(time_s), np.zeros_like(time_s)
    for amplitude, hertz, phase in ((0.5, 0.5, 0.0), (0.25, 1.3, 0.7), (0.15, 3.1, 2.0)):
        angle = 2 * np.pi * hertz * time_s + phase
        position += amplitude * np.sin(angle)
        speed += amplitude * 2 * np.pi * hertz * np.cos(angle)
    return position, speed


def measured(position: FloatArray, bench: Bench, phase_rad: FloatArray) -> FloatArray:
    """Returns what encoders with their own zero (n_device,) [rad] say of positions (..., n_device)."""
    return np.asarray(bench.quantum_rad * np.round((position - phase_rad) / bench.quantum_rad) + phase_rad)


def simulate(
    parameters: FloatArray, bench: Bench, phase_rad: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Simulates devices in closed loop.

    Args:
        parameters (n_device, 5): Parameters in the order of `NAMES`.
        bench: The loop.
        phase_rad (n_device,): Zeros of the encoders; without them the loop sees the motion itself, as an
            instrument does.

    Returns:
        True positions (n_sample, n_device) [rad] and commanded torques [N m], those held from that sample on.
    """
    n_sample = round(bench.duration_s / bench.sampling_period_s)
    wanted, wanted_speed = reference(np.arange(n_sample) * bench.sampling_period_s)
    inertia, moment_x, moment_y, viscous, coulomb = np.asarray(parameters).T
    step = bench.sampling_period_s / bench.substeps
    stiffness, damper = bench.gains
    position = np.full(len(parameters), wanted[0])
    speed = np.full(len(parameters), wanted_speed[0])
    seen_before = position - wanted_speed[0] * bench.sampling_period_s
    positions, torques = np.empty((n_sample, len(parameters))), np.empty((n_sample, len(parameters)))
    lost = coulomb * step / inertia
    for sample in range(n_sample):
        seen = position if phase_rad is None else measured(position, bench, phase_rad)
        seen_speed = (seen - seen_before) / bench.sampling_period_s
        torque = stiffness * (wanted[sample] - seen) + damper * (wanted_speed[sample] - seen_speed)
        seen_before, positions[sample], torques[sample] = seen, position, torque
        for _ in range(bench.substeps):
            gravity = GRAVITY * (moment_x * np.cos(position) - moment_y * np.sin(position))
            free = speed + step * (torque + gravity - viscous * speed) / inertia
            speed = free - np.clip(free, -lost, lost)  # friction stops, it does not reverse
            position = position + step * speed
    return positions, torques
