"""Two motors on one elastic load under sampled speed control with coloured noise, and its exact theory."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_discrete_lyapunov
from scipy.signal import cont2discrete

from robid.signals.quantities import motor_channels
from robid.signals.record import Record

STEP_S, N_SAMPLE = 4e-3, 256
LINES = np.arange(9, 50, 4)
OMEGA = 2 * np.pi * LINES / (N_SAMPLE * STEP_S)
MOTORS = 2
SPEED_GAIN, POSITION_GAIN = 0.1, 10.0
TORQUE_POLE, SENSOR_POLE = 0.9, 0.5


def plant():
    """States (angles of motors and load, their speeds), held torques in, motor angles out: exactly discretised."""
    mass = np.diag([1.0e-3, 1.5e-3, 2.0e-3])
    stiffness = np.array([[40.0, 0, -40], [0, 60, -60], [-40, -60, 100]])
    damping = np.array([[0.03, 0, -0.02], [0, 0.04, -0.03], [-0.02, -0.03, 0.15]])
    lower = -np.linalg.solve(mass, np.hstack([stiffness, damping]))
    A = np.vstack([np.hstack([np.zeros((3, 3)), np.eye(3)]), lower])
    B = np.vstack([np.zeros((3, 2)), np.linalg.inv(mass)[:, :2]])
    return cont2discrete((A, B, np.eye(2, 6), np.zeros((2, 2))), STEP_S)[:3]


A_PLANT, B_PLANT, C_PLANT = plant()
N_STATE = 6 + 3 * MOTORS


@dataclass(frozen=True)
class Loop:
    """The loop with its noise and, on request, a cubic sensor.

    Attributes:
        torque_noise: Innovation of the first-order disturbance at each motor's torque [N m].
        sensor_noise: Innovation of the first-order noise of each measured angle [rad].
        cubic: The sensor shows `q + cubic q^3` [1/rad^2].
    """

    torque_noise: float
    sensor_noise: float
    cubic: float = 0.0

    def step(self, state, reference, white):
        """State (n_state, n_run), reference (2, n_run), white (4, n_run) to the next state, torque and angle."""
        inner, last, disturbance, sensor = np.split(state, [6, 8, 10])
        angle = C_PLANT @ inner
        measured = angle + self.cubic * angle**3 + sensor
        torque = SPEED_GAIN * (reference - POSITION_GAIN * measured - (measured - last) / STEP_S)
        return (
            np.concatenate(
                [
                    A_PLANT @ inner + B_PLANT @ (torque + disturbance),
                    measured,
                    TORQUE_POLE * disturbance + self.torque_noise * white[:2],
                    SENSOR_POLE * sensor + self.sensor_noise * white[2:],
                ]
            ),
            torque,
            measured,
        )

    def matrices(self):
        """State space (A, B, C, D) from (reference, white) to (torque, angle), by probing the step."""
        size = N_STATE + 6
        unit = np.eye(size)
        state, torque, angle = self.step(unit[:N_STATE], unit[N_STATE : N_STATE + 2], unit[N_STATE + 2 :])
        output = np.concatenate([torque, angle])
        return state[:, :N_STATE], state[:, N_STATE:], output[:, :N_STATE], output[:, N_STATE:]

    def simulate(self, reference, generator, *, periods, transient_periods=5):
        """Plays one period of reference (..., n_sample, 2); returns torque and angle (..., period, sample, 2)."""
        shape = reference.shape[:-2]
        played = np.ascontiguousarray(np.moveaxis(reference.reshape(-1, N_SAMPLE, MOTORS), 0, -1))
        n_run = played.shape[-1]
        state, white = np.zeros((N_STATE, n_run)), np.empty((4, n_run))
        torque, angle = (np.empty((periods, N_SAMPLE, MOTORS, n_run)) for _ in range(2))
        for period in range(-transient_periods, periods):
            for sample in range(N_SAMPLE):
                generator.standard_normal(out=white)
                state, now, measured = self.step(state, played[sample], white)
                if period >= 0:
                    torque[period, sample], angle[period, sample] = now, measured
        back = (np.moveaxis(each, -1, 0).reshape(*shape, periods, N_SAMPLE, MOTORS) for each in (torque, angle))
        return tuple(back)

    def response(self):
        """Torque to angular acceleration (n_freq, 2, 2) by the plant's own state space."""
        return -(OMEGA**2)[:, None, None] * transfer(A_PLANT, B_PLANT, C_PLANT)

    def torque_spectrum(self, reference):
        """Noise-free torque (..., n_freq, 2, n_exp) that a reference spectrum of the same shape causes."""
        A, B, C, D = self.matrices()
        return (transfer(A, B[:, :2], C[:2]) + D[:2, :2]) @ reference

    def noise(self, periods):
        """Covariance (n_freq, 4, 4) of (torque, acceleration) amplitudes of the mean over the periods.

        Exact for a stationary loop, leakage and the removal of drift included.
        """
        A, B, C, D = self.matrices()
        B, D = B[:, 2:], D[:, 2:]
        states = solve_discrete_lyapunov(A, B @ B.T)
        auto, later = [C @ states @ C.T + D @ D.T], A @ states @ C.T + B @ D.T
        for _ in range(periods * N_SAMPLE - 1):
            auto.append(C @ later)
            later = A @ later
        auto = np.array(auto)
        weights = np.fft.fft(amplitude_weights(periods), 2 * len(auto))
        overlap = np.fft.ifft(weights[:, None] * weights.conj())[..., : len(auto)].repeat(2, axis=0).repeat(2, axis=1)
        ahead = np.einsum("tij,ijkt->kij", auto, overlap)
        return ahead + np.swapaxes(ahead, 1, 2).conj() - auto[0] * np.moveaxis(overlap[..., 0], -1, 0)

    def residual_noise(self, periods):
        """Covariance of the output residual V = Y - G U, and of V with the torque, both (n_freq, 2, 2)."""
        both = self.noise(periods)
        take = np.concatenate([-self.response(), np.broadcast_to(np.eye(2), (LINES.size, 2, 2))], axis=2)
        return take @ both @ np.swapaxes(take, 1, 2).conj(), take @ both[:, :, :2]


def amplitude_weights(periods):
    """What the samples of torque and angle are multiplied by in the mean's amplitudes (2, n_freq, n_sample)."""
    time = np.arange(periods * N_SAMPLE)
    wave = np.exp(-1j * STEP_S * np.outer(OMEGA, time)) / time.size
    ramp = wave[:, :N_SAMPLE] @ ((np.arange(N_SAMPLE) + 0.5) / N_SAMPLE - 0.5) * periods
    slope = np.gradient(np.eye(periods), axis=0).mean(axis=0) if periods > 1 else np.zeros(1)
    drift = ramp[:, None] * np.repeat(slope, N_SAMPLE) / N_SAMPLE
    return np.array([wave, -(OMEGA**2)[:, None] * (wave - drift)])


def transfer(A, B, C):
    z = np.exp(1j * OMEGA * STEP_S)
    return C @ np.linalg.solve(z[:, None, None] * np.eye(len(A)) - A, B[None].astype(complex))


def draw_reference(generator, shape, rms):
    """Orthogonal random-phase speed references of `shape` blocks: spectra and one period of samples.

    Returns:
        Amplitudes (*shape, n_freq, 2, n_exp) as DFT over the number of samples, and signals (*shape, exp, sample, 2).
    """
    phases = generator.uniform(0, 2 * np.pi, (*shape, LINES.size, MOTORS, 1))
    size = rms * np.sqrt(2 / LINES.size) * np.array([[1.0], [0.7]])
    spectrum = 0.5 * size * np.exp(1j * phases) * np.array([[1.0, 1.0], [1.0, -1.0]])
    wave = 2 * np.exp(2j * np.pi * np.outer(np.arange(N_SAMPLE), LINES) / N_SAMPLE)
    return spectrum, np.real(np.einsum("sk,...kie->...esi", wave, spectrum))


def loop_record(reference, torque, angle):
    """The record of one run: reference (real, exp, sample, 2), torque and angle (real, exp, period, sample, 2)."""
    names = ("first", "second")
    return Record(
        sampling_period_s=STEP_S,
        configurations=np.zeros((1, MOTORS)),
        inputs=torque[None],
        outputs=angle[None],
        reference=reference[None],
        reference_channels=motor_channels(names, "speed_reference"),
        excited_lines=LINES,
        detection_lines=np.zeros(0, int),
        input_channels=motor_channels(names, "torque"),
        output_channels=motor_channels(names, "angle"),
        output_offset=np.zeros((1, MOTORS)),
    )
