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
# # Your own arm: from URDF to model
# For anyone with a URDF or MJCF of a robot who wants to know, before measuring, which springs and dampers can be identified. Such a
# model has frames, masses and limits, but no gear ratios, rotor inertias or springs: `robid init` adds a table of them. You need
# `pip install 'robid[notebook]'`.
#
# The first cell writes the URDF of an arm with two joints, as an example. **Your own arm: change `MODEL` in the second cell.** Nothing
# else in this notebook depends on the robot.

# %%
import subprocess
from pathlib import Path

URDF = """\
<robot name="two_joints">
  <link name="world"/>
  <link name="upper_arm"><inertial>
    <origin xyz="0.25 0 0.05"/><mass value="14"/>
    <inertia ixx="0.08" iyy="0.5" izz="0.5" ixy="0" ixz="0" iyz="0"/>
  </inertial></link>
  <link name="forearm"><inertial>
    <origin xyz="0.2 0 0.03"/><mass value="8"/>
    <inertia ixx="0.04" iyy="0.2" izz="0.2" ixy="0" ixz="0" iyz="0"/>
  </inertial></link>
  <joint name="shoulder" type="revolute">
    <parent link="world"/><child link="upper_arm"/><origin xyz="0 0 0.4" rpy="-1.5708 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-1.5" upper="1.5" effort="400" velocity="3"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper_arm"/><child link="forearm"/><origin xyz="0.55 0 0.1"/><axis xyz="0 0 1"/>
    <limit lower="-2.2" upper="2.2" effort="200" velocity="3"/>
  </joint>
</robot>
"""
Path("two_joints.urdf").write_text(URDF, encoding="utf-8")

# %%
import matplotlib.pyplot as plt
import numpy as np

import robid

MODEL = "two_joints.urdf"  # <-- the path of your URDF or MJCF
LOWEST_HZ, HIGHEST_HZ = 2, 80  # <-- the band in which its resonances are expected


def robid_command(*words):
    """Runs a command of robid, and shows what it says."""
    done = subprocess.run(["robid", *words], capture_output=True, text=True, check=False)
    print(done.stdout + done.stderr)
    assert done.returncode == 0


# %% [markdown]
# ## A robot file and an experiment from the model

# %%
robid_command("init", "arm", "--model", MODEL)

# %%
print(Path("arm/arm_robot.yaml").read_text(encoding="utf-8"))

# %% [markdown]
# ## What the model does not contain
# The table of joints has typical values, listed under `assumed`. Replace them by those of your data sheets, and remove their names
# from the list. `robid status` checks both files and computes nothing.

# %%
robid_command("status", "arm/arm.yaml")

# %% [markdown]
# ## Which configurations to measure
# The experiment does this by itself (`designs`). From Python it is one call. It chooses, from sixty candidates, the configurations
# that determine springs and dampers best, with a certificate of how near the choice is to the best possible.

# %%
arm = robid.load_robot("arm/arm_robot.yaml")
middle, half = (arm.upper + arm.lower) / 2, 0.45 * (arm.upper - arm.lower)  # 90 % of the range of each joint
candidates = np.random.default_rng(1).uniform(middle - half, middle + half, (60, len(arm.joints)))
lines = np.geomspace(LOWEST_HZ, HIGHEST_HZ, 40)
design = robid.choose_configurations(arm, candidates, lines, 6)
print(candidates[design.chosen].round(2))  # rad, or m
print(f"{design.efficiency:.0%} of the best possible")

# %% [markdown]
# ## Simulate before you measure
# The run simulates the arm in closed loop. Its springs differ from the file by up to a factor of two, and the fit has to find them.
# With two joints it takes about two minutes on one core; with six, rather a quarter of an hour.

# %%
robid_command("run", "arm/arm.yaml", "--backend", "serial")

# %%
run = robid.open("runs/arm")
fit = run.fits["elastic"]
print(fit.sentence)
print(fit.parameters)

# %% [markdown]
# ## Resonances over the workspace
# The fitted robot has a response in any configuration. Here it is the first joint's own, at three positions of the second joint.

# %%
found = arm.with_fit(fit)
dense = np.geomspace(LOWEST_HZ, HIGHEST_HZ, 400)
for share in (-0.8, 0.0, 0.8):
    configuration = middle.copy()
    configuration[1] += share * half[1]
    G = found.response(configuration[None], dense)
    plt.loglog(dense, np.abs(G[0, :, 0, 0]), label=f"{arm.joints[1]} at {configuration[1]:.2g}")
plt.xlabel("frequency [Hz]")
plt.ylabel("acceleration over torque [rad/s² per N m]")
plt.legend()

# %% [markdown]
# ## With the real robot
# 1. Play `runs/arm/estimation/excitation.h5`: `robid export` writes it for your controller.
# 2. Let `robid init --log` or `robid inspect LOG --propose` write the campaign that imports your logs.
# 3. Run the experiment again.

# %%
assert fit.grade.value == 2
