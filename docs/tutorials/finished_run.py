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
# # Reading and plotting a finished run
# For anyone who wants to use the results of a run in Python. A run folder contains all that was measured, estimated and fitted. You
# need `pip install 'robid[notebook]'`. The first cell runs the smallest example; with a run of your own, begin at `robid.open`.

# %%
import subprocess

import matplotlib.pyplot as plt
import numpy as np

import robid

subprocess.run(["robid", "init", "drive", "--example", "drive"], check=True)
subprocess.run(["robid", "run", "drive/drive.yaml", "--backend", "serial"], check=True)

# %%
run = robid.open("runs/drive")
run

# %% [markdown]
# ## What was found, and how far to trust it
# A fit states its grade, and why it is no better. Each parameter has two intervals: of the parameter itself, and of the value that
# predicts best.

# %%
fit = run.fits["elastic"]
print(fit.sentence)
print(fit.parameters)

# %%
table = fit.parameters.to_pandas()
table[["value", "lower", "upper", "effective_lower", "effective_upper", "unit", "identified"]]

# %% [markdown]
# ## The measured response with its uncertainty
# The total covariance comes from the differences between realizations: it includes the distortion by friction and other
# nonlinearities. The noise covariance comes from the differences between periods.

# %%
measured = run.responses["estimation"]
magnitude = np.abs(measured.response[0, :, 0, 0])  # (configuration, frequency, output, input)
deviation = np.sqrt(measured.element_variance()[0, :, 0, 0])
noise = np.sqrt(measured.element_variance(noise_only=True)[0, :, 0, 0])
plt.loglog(measured.frequency_hz, magnitude, ".-", label="motor's own response")
plt.loglog(measured.frequency_hz, deviation, label="standard deviation")
plt.loglog(measured.frequency_hz, noise, ":", label="of it noise")
plt.xlabel("frequency [Hz]")
plt.ylabel("acceleration over torque [rad/s² per N m]")
plt.legend()

# %% [markdown]
# ## The model in a configuration that was not measured
# `with_fit` inserts the estimates into the robot file's model.

# %%
robot = robid.load_robot("drive/drive_robot.yaml").with_fit(fit)
lines = np.geomspace(1, 80, 300)
somewhere = np.radians([[45.0]])  # one configuration is two-dimensional
model = robot.response(somewhere, lines)
plt.figure()
plt.loglog(lines, np.abs(model[0, :, 0, 0]), label="model at 45°")
plt.loglog(measured.frequency_hz, magnitude, ".", label="measured at 0°")
plt.xlabel("frequency [Hz]")
plt.ylabel("acceleration over torque [rad/s² per N m]")
plt.legend()

# %% [markdown]
# ## The signals
# Records keep inputs and outputs over time.

# %%
record = run.records["estimation"]  # (configuration, realization, experiment, period, sample, channel)
time_s = record.sampling_period_s * np.arange(record.inputs.shape[4])
plt.figure()
plt.plot(time_s, record.inputs[0, 0, 0, 0, :, 0])
plt.xlabel("time [s]")
plt.ylabel("motor torque [N m]")

# %% [markdown]
# ## Numbers of the report
# `figures` has the numbers of the report's tables, by dotted name.

# %%
recovered = {name: value for name, value in run.figures.items() if "recovery" in name or "grade" in name}
for name, value in recovered.items():
    print(f"{name}: {value}")
assert fit.grade.value == 2
