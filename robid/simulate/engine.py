"""What every closed-loop simulation does with the engine: build the true robot, stay quiet, refuse explosions."""

from __future__ import annotations

import contextlib
import ctypes
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
from mujoco.batch import Batch

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.robot.description import Robot
from robid.robot.friction import LAWS
from robid.robot.model import ElasticModel, build_model
from robid.robot.quiet import quiet_warnings
from robid.simulate.options import Controller, SimulateOptions
from robid.simulate.truth import with_imperfections


def true_model(robot: Robot, controller: Controller, options: SimulateOptions, *, sensors: bool) -> ElasticModel:
    """Builds the robot with the imperfections that act inside the integrator; the number of steps is settled."""
    flaws = options.imperfections
    if options.steps_per_sample is None:
        message = "the number of steps per sample must be settled first"
        raise ValueError(message)
    return build_model(
        with_imperfections(robot, flaws),
        friction=LAWS.get(flaws.friction),
        ripple=flaws.ripple,
        second_ripple=(flaws.second_ripple_nm, flaws.second_ripple_order),
        backlash=(flaws.backlash_rad, flaws.backlash_m),
        hysteresis=(flaws.hysteresis_nm, flaws.hysteresis_n),
        timestep_s=controller.sampling_period_s / options.steps_per_sample,
        sensors=sensors,
        balanced=True,
    )


def refuse_explosion(batch: Batch, robot: Robot, configuration: FloatArray, index: int, when: str) -> None:
    """Raises a DataError that names the configuration if any simulation of it is no longer sound."""
    if not batch.warning.any() and np.isfinite(batch.qpos).all():
        return
    raise DataError(
        f"D217 the simulation blew up in {when}",
        where=f"configuration {index + 1} at {robot.shown(configuration)}",
        remedy="lower the speed loop's bandwidth or the excitation, raise steps_per_sample, check springs and inertias",
    )


@contextlib.contextmanager
def quiet_mujoco() -> Iterator[None]:
    """Keeps MuJoCo's warnings off screen and log files, where the batch counts them, and its clock off."""
    with quiet_warnings(), _unclocked():
        yield


@contextlib.contextmanager
def _unclocked() -> Iterator[None]:
    """Takes away the clock that the Python package gives the engine, which asks it several times in every step.

    The package's own setter knows clocks in Python only; where the library is not found, the clock stays.
    """
    library = next(Path(mujoco.__file__).parent.glob("libmujoco.*"), None)
    if library is None:
        yield
        return
    clock = ctypes.c_void_p.in_dll(ctypes.CDLL(str(library)), "mjcb_time")
    before = clock.value
    clock.value = None
    try:
        yield
    finally:
        clock.value = before
