"""Nuisance parameters, what a robot file may have wrong: their standard deviations, as no data sheet states them."""

from __future__ import annotations

from dataclasses import dataclass

from robid.arrays import option


@dataclass(frozen=True)
class NuisanceStd:
    """Standard deviations of what a robot file may have wrong; zero for what is taken for granted."""

    mass_relative_std: float = option(0.05, "Of a link's mass, its inertia with it, relative.", ge=0)
    com_m: float = option(0.01, "Of each coordinate of a link's centre of mass [m].", ge=0)
    inertia_relative_std: float = option(0.1, "Of a link's inertia about its centre of mass, relative.", ge=0)
    payload_relative_std: float = option(0.02, "Of the payload's mass, its inertia with it, relative.", ge=0)
    payload_com_m: float = option(0.01, "Of each coordinate of the payload's centre of mass [m].", ge=0)
    payload_inertia_relative_std: float = option(
        0.1, "Of the payload's inertia about its centre of mass, relative.", ge=0
    )
    torque_relative_std: float = option(0.02, "Of a motor's torque constant, relative.", ge=0)
    coupling_std: float = option(0.002, "Of a gear coupling, arm turns of this joint per arm turn of another.", ge=0)
    arm_friction: float = option(
        0.05,
        "Of viscous friction behind the transmission, over the torque of the link's own inertia at 10 Hz; "
        "where `arm_viscous` is not estimated.",
        ge=0,
    )
    friction: float = option(
        0.02,
        "Of the friction that remains in a motor's torque, over the torque of its rotor's inertia at 10 Hz. It is a "
        "part in phase with the angle, one that dissipates energy and, where `viscous` is not estimated, one that "
        "grows with speed.",
        ge=0,
    )
    loss_factor: float = option(0.02, "Of the largest loss factor of a gear's hysteresis, which stiffens it too.", ge=0)
    stiffness_relative_std: float = option(
        0.1, "Of a spring's stiffness, relative; where `stiffness` is not estimated.", ge=0
    )
    damping_relative_std: float = option(
        0.3, "Of a spring's damping, relative; where `damping` is not estimated.", ge=0
    )
    load_stiffness: float = option(0.1, "Of a gear's stiffness over the range of its loads, relative.", ge=0)
    delay_s: float = option(5e-5, "Of the drives' delay [s]; where `delay` is not estimated.", ge=0)
    compliance: float = option(
        0.05, "Of the compliance of bearings and base that the file lacks, over that of the joint's gear.", ge=0
    )
    zero_deg: float = option(0.5, "Of the zero of a revolute joint, true minus reported angle [deg].", ge=0)
    chain_compliance: float = option(
        0.12,
        "Of the share of a gear's fitted compliance that belongs to links, shafts and hinges in line with it; "
        "no share is negative.",
        ge=0,
    )
