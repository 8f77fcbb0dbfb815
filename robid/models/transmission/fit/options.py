"""Options of a fit of gears to two encoders."""

from __future__ import annotations

from dataclasses import dataclass, field

from robid.arrays import group, option


@dataclass(frozen=True)
class GearOptions:
    """What a gear may have beside its linear stiffness, and beside which signals it is seen."""

    stiffening: bool = option(True, "Whether stiffness grows with the square of the deflection.")
    hysteresis: bool = option(True, "Whether the gear has hysteresis, of one element of Dahl.")
    backlash: bool = option(True, "Whether the deflection changes its side in a narrow band about zero torque.")
    motor_orders: tuple[float, ...] = option(
        (1.0, 2.0),
        "Transmission error: its periods per turn of the joint's motor, such as 1 and 2 of the motor's encoder and "
        "shaft, and those of the gear's own wheels.",
    )
    arm_orders: tuple[float, ...] = option(
        (1.0,), "Its periods per turn of the arm, 1 for the eccentricity of the arm's encoder."
    )


@dataclass(frozen=True)
class PriorOptions:
    """What is known beforehand of what the motions do not tell by themselves, as standard deviations."""

    friction_share: float = option(
        0.15,
        "Of the share of a motor's friction that acts behind its gear although the robot file states it at the motor.",
        ge=0,
    )
    backlash_rad: float = option(1e-4, "Of the backlash, arm side, of prismatic joints in metres [rad].", ge=0)
    hysteresis_shape: float = option(
        0.3, "Of the share of hysteresis that builds up over twice the deflection, and not over half of it.", ge=0
    )
    model_error: float = option(
        0.0125, "Of what a gear does beside its law, over the size of its deflection along a motion.", ge=0
    )
    eccentricity_rad: float = option(1e-4, "Of the amplitude of errors with periods per turn of the arm [rad].", ge=0)
    transmission_error_rad: float = option(
        2e-4, "Of the amplitude of each other transmission error, arm side [rad].", ge=0
    )
    lag_s: float = option(0.02, "Of the lag of the arm's encoder behind the motor's [s].", gt=0)
    torque_lag_s: float = option(2e-3, "Of damping over stiffness, with the lag of the torque [s].", ge=0)
    scale: float = option(1e-3, "Of the relative difference of the two encoders' scales, gear ratio included.", ge=0)


@dataclass(frozen=True)
class TransmissionFitOptions:
    """How gears are estimated from the angles of motors and arms."""

    gear: GearOptions = group(GearOptions, "Parts of the gears' law.")
    prior: PriorOptions = group(PriorOptions, "What is known beforehand.")
    fine_cut_hz: float = option(
        200.0,
        "Cut-off up to which deflections are followed where hysteresis remembers them, transmission errors at motor "
        "turns included; at most a fifth of the sampling rate [Hz].",
        gt=0,
    )
    cut_hz: float = option(
        4.0,
        "Cut-off of the low pass of torques and deflections alike: above the motion, and below the first resonance, "
        "from where on links move otherwise than the encoders show [Hz].",
        gt=0,
    )
    rated_torque_nm: dict[str, float] = field(
        default_factory=dict,
        metadata={
            "description": "Rated torque of gears at their output, by joint, at which lost motion is measured [N m]. "
            "When not given, gear ratio times `rated_torque_nm` of the motor; else the largest torque in the records."
        },
    )
    stiffness_torques_nm: dict[str, tuple[float, ...]] = field(
        default_factory=dict,
        metadata={
            "description": "Torques at gears' outputs, by joint, at which their data sheets let the stiffness change, "
            "as T1 and T2: it is then constant in between, in place of a cubic law [N m]."
        },
    )
    confidence: float = option(0.95, "Level of the confidence intervals.", gt=0, lt=1)
    identifiable_relative_std: float = option(
        0.1, "Relative standard deviation up to which a stiffness counts as identified.", gt=0
    )
