# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # A two-mass drive from a CSV
# For anyone with a CSV of a drive: a motor turns a load through a coupling. The log has the motor's torque and angle. The fit
# estimates the coupling's stiffness and damping, with intervals. You need `pip install 'robid[notebook]'`.
#
# The first cell makes the log of a drive with known values, so that you can check the result. With a log of your own, leave it out.

# %%
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import cont2discrete

import robid

MOTOR, LOAD, STIFFNESS, DAMPING = 4.8e-3, 4.7e-3, 546.0, 0.2  # kg m^2, kg m^2, N m/rad, N m s/rad
STEP_S, PERIOD_S, PERIODS, REALIZATIONS = 1e-3, 0.5, 4, 4
LINES = np.arange(10, 81)  # excited multiples of 1 / PERIOD_S: 20 to 160 Hz

spring, damper = (value * np.array([[-1, 1], [1, -1]]) / np.array([[MOTOR], [LOAD]]) for value in (STIFFNESS, DAMPING))
A = np.block([[np.zeros((2, 2)), np.eye(2)], [spring, damper]])
B = np.array([[0.0], [0.0], [1 / MOTOR], [0.0]])
held, gain, *_ = cont2discrete((A, B, np.eye(4), np.zeros((4, 1))), STEP_S)  # the torque is held for a sample

generator = np.random.default_rng(2)
n_sample = round(PERIOD_S / STEP_S)
rows = []
for realization in range(REALIZATIONS):
    spectrum = np.zeros(n_sample // 2 + 1, complex)
    spectrum[LINES] = 20 * np.exp(2j * np.pi * generator.uniform(size=LINES.size))
    angle = np.zeros_like(spectrum)
    for line in LINES:  # steady state: what has settled repeats from period to period
        z = np.exp(2j * np.pi * line / n_sample)
        angle[line] = np.linalg.solve(z * np.eye(4) - held, gain)[0, 0] * spectrum[line]
    torque, turned = np.fft.irfft(spectrum, n_sample), np.fft.irfft(angle, n_sample)
    for _ in range(PERIODS):
        noise = 1e-3 * turned.std() * generator.normal(size=n_sample)
        rows.append(np.column_stack([np.full(n_sample, realization), torque, turned + noise]))
np.savetxt("drive.csv", np.concatenate(rows), delimiter=",", header="realization,torque_nm,angle_rad", comments="")

# %% [markdown]
# ## Read the log
# Signals have the axes *(realization, experiment, period, sample, channel)*. Each realization plays other random phases, and its
# periods repeat. Differences between periods are noise; differences between realizations include distortion.

# %%
table = np.genfromtxt("drive.csv", delimiter=",", names=True)
shape = (REALIZATIONS, 1, PERIODS, n_sample, 1)
record = robid.make_record(
    table["torque_nm"].reshape(shape),
    table["angle_rad"].reshape(shape),
    STEP_S,
    frequency_hz=LINES / PERIOD_S,
    names=["drive"],
)

# %% [markdown]
# ## Estimate the frequency response
# The response is from torque to acceleration, with its covariance. Half of the realizations are kept for validation.

# %%
def some(first, last):
    """A part of the realizations."""
    return robid.make_record(
        record.inputs[:, first:last],
        record.outputs[:, first:last],
        STEP_S,
        frequency_hz=LINES / PERIOD_S,
        names=["drive"],
    )


responses = robid.estimate_frf(some(0, 2))
kept_back = robid.estimate_frf(some(2, 4))

# %%
G = responses.response[0, :, 0, 0]  # (configuration, frequency, output, input)
deviation = np.sqrt(responses.element_variance()[0, :, 0, 0])
plt.loglog(responses.frequency_hz, np.abs(G), label="measured")
plt.loglog(responses.frequency_hz, deviation, ":", label="standard deviation")
plt.xlabel("frequency [Hz]")
plt.ylabel("acceleration over torque [rad/s² per N m]")
plt.legend()

# %% [markdown]
# ## Describe the drive
# The robot file states what is known, and where the springs are. Stiffness and damping are rough starting values.

# %%
Path("drive_robot.yaml").write_text(
    """\
schema_version: 2
name: drive
gravity_m_s2: [0, 0, 0]
controller: {sampling_period_s: 1.0e-3, delay_samples: 0}
joints:
  - name: drive
    dh: {d_m: 0, a_m: 0, alpha_deg: 0, offset_deg: 0}
    limits_deg: [-180, 180]
    link: # the load; only zz moves
      mass_kg: 1
      com_m: [0, 0, 0]
      inertia_kgm2: {xx: 4.7e-3, yy: 4.7e-3, zz: 4.7e-3}
    motor: {inertia_kgm2: 4.8e-3, gear_ratio: 1, max_speed_rad_s: 300, max_torque_nm: 10}
springs:
  - {name: coupling, joint: drive, place: transmission, stiffness_nm_rad: 300, damping_nms_rad: 0.05}
""",
    encoding="utf-8",
)
drive = robid.load_robot("drive_robot.yaml")
drive

# %% [markdown]
# ## Fit, and read how far to trust it
# The first interval is that of the parameter itself: it includes what the robot file may have wrong. All data are from one
# configuration, so the grade cannot be the best.

# %%
fit = robid.fit_model("elastic", drive, responses, validate_on=kept_back, starts=4)
print(fit)

# %%
fit.parameters.to_pandas()

# %% [markdown]
# ## Compare model and measurement

# %%
model = drive.with_fit(fit).response(responses.configurations, responses.frequency_hz)
plt.figure()
plt.loglog(responses.frequency_hz, np.abs(G), ".", label="measured")
plt.loglog(responses.frequency_hz, np.abs(model[0, :, 0, 0]), label="model")
plt.xlabel("frequency [Hz]")
plt.ylabel("acceleration over torque [rad/s² per N m]")
plt.legend()

# %% [markdown]
# The drive was simulated, so the true value is known.

# %%
coupling = fit.parameters["coupling.stiffness"]
print(f"{coupling.value:.1f} [{coupling.lower:.1f}, {coupling.upper:.1f}] {coupling.unit}, true {STIFFNESS:g}")
assert coupling.lower < STIFFNESS < coupling.upper
