"""Linear state space of the elastic robot at rest, continuous and sampled with its hold and delay."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from robid.arrays import FloatArray
from robid.robot.linearize import LinearModel
from robid.robot.response import ElasticParameters, motion_matrices

_SAME_INSTANT = 1e-9  # of a period
_JUMPING = ".acceleration"


@dataclass(frozen=True)
class StateSpace:
    """`x' = A x + B u, y = C x + D u`, or `x[k+1] = A x[k] + B u[k]`; deviations from rest, SI units."""

    A: FloatArray  # (n_state, n_state) System matrix
    B: FloatArray  # (n_state, n_in) Input matrix
    C: FloatArray  # (n_out, n_state) Output matrix
    D: FloatArray  # (n_out, n_in) Direct feedthrough
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    period_s: float | None = None  # Sampling period [s]; None in continuous time


def state_space(
    model: LinearModel,
    parameters: ElasticParameters,
    configuration: int,
    motors: tuple[str, ...],
    springs: tuple[str, ...],
    outputs: tuple[str, ...],
) -> StateSpace:
    """Writes one configuration as a continuous state space, without the delay.

    States are motor angles, spring deflections and their rates; outputs the angles, then speeds, then accelerations.

    Source:
        docs/methods, sec. 1 (Linearisation), in spring coordinates.
    """
    mass, damping, stiffness = motion_matrices(model, parameters, configuration)
    n, n_motor, output = len(mass), model.n_motor, model.output[configuration]
    # M z'' = -(K z + D z') + B u as rows of accelerations.
    solved = np.linalg.solve(mass, np.hstack([stiffness, damping, np.eye(n, n_motor)]))
    back, drive, none = -solved[:, : 2 * n], solved[:, 2 * n :], np.zeros_like(output)
    states = [(motors, "motor_angle"), (springs, "deflection"), (motors, "motor_speed"), (springs, "deflection_rate")]
    # An accelerometer reads its motion less gravity, which its tilt turns into view.
    acceleration = output @ back - np.hstack([model.tilt[configuration], none])
    return StateSpace(
        A=np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), back]),
        B=np.vstack([np.zeros((n, n_motor)), drive]),
        C=np.vstack([np.hstack([output, none]), np.hstack([none, output]), acceleration]),
        D=np.vstack([np.zeros((2 * len(output), n_motor)), output @ drive]),
        states=tuple(f"{name}.{state}" for names, state in states for name in names),
        inputs=tuple(f"{name}.torque" for name in motors),
        outputs=tuple(f"{name}.{kind}" for kind in ("angle", "speed", "acceleration") for name in outputs),
    )


def discretise(system: StateSpace, period_s: float, delay_s: float) -> StateSpace:
    """Samples a continuous state space whose inputs are held for a period and applied after a delay; exact.

    Args:
        system: Continuous system.
        period_s: Sampling period [s].
        delay_s: Delay from the command to its effect, hold excluded [s]; any share of a period.

    Returns:
        The sampled system. Torques that still wait are states after the continuous ones. Accelerations
        are left out: where they jump with the torque they have two values at the sampling instant.

    Raises:
        ValueError: If the delay is negative.

    Source:
        Åström and Wittenmark, Computer-Controlled Systems (1997), sec. 2.3 (systems with time delay).
    """
    if delay_s < 0:
        message = f"Argument `delay_s` must not be negative, but is {delay_s:g}."
        raise ValueError(message)
    n, n_in = system.B.shape
    whole = int(np.floor(delay_s / period_s + _SAME_INSTANT))
    part = max(0.0, delay_s - whole * period_s)
    # A delay of whole samples only shifts commands; the state then waits for none within the period.
    part = part if part > _SAME_INSTANT * period_s else 0.0
    waiting = whole + (part > 0)
    # Within a period the old command acts for `part`, the new one for the rest: A and both effects follow by exp.
    first, late = _held(system, period_s - part), _held(system, part)
    total = n + waiting * n_in
    A, B = np.zeros((total, total)), np.zeros((total, n_in))
    A[:n, :n] = late[0] @ first[0]
    # Column blocks of the commands u[k], u[k-1], ...: u[k] is the input, the others wait as states.
    effects = {whole: first[1], whole + 1: first[0] @ late[1]} if part > 0 else {whole: first[1]}
    for age, effect in effects.items():
        if age == 0:
            B[:n] = effect
        else:
            A[:n, n + (age - 1) * n_in : n + age * n_in] = effect
    if waiting:
        B[n : n + n_in] = np.eye(n_in)
        A[n + n_in :, n:-n_in] = np.eye((waiting - 1) * n_in)
    kept = [row for row, name in enumerate(system.outputs) if not name.endswith(_JUMPING)]
    return StateSpace(
        A=A,
        B=B,
        C=np.hstack([system.C[kept], np.zeros((len(kept), waiting * n_in))]),
        D=system.D[kept],
        states=(*system.states, *(f"{name}[k-{age + 1}]" for age in range(waiting) for name in system.inputs)),
        inputs=system.inputs,
        outputs=tuple(system.outputs[row] for row in kept),
        period_s=period_s,
    )


def _held(system: StateSpace, time_s: float) -> tuple[FloatArray, FloatArray]:
    """Transition of the state over a time, and the effect of an input held meanwhile."""
    n, n_in = system.B.shape
    generator = np.zeros((n + n_in, n + n_in))
    # exp([[A, B], [0, 0]] t) = [[exp(A t), int exp(A s) ds B], [0, 1]]: both at once, for singular A too.
    generator[:n, :n], generator[:n, n:] = system.A, system.B
    power = expm(generator * time_s)
    return power[:n, :n], power[:n, n:]
