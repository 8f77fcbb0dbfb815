"""Options of the simulated experiment."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from robid.arrays import option
from robid.robot.friction import LAWS, LawName

# Limits of the rule; a change of one changes what the settings ask for, so they are among the settings that decide.
STEP_LIMITS = {
    "response_error": 1e-3,
    **{name: most for law in LAWS.values() for name, most in law.step_limits.items()},
}


@dataclass(frozen=True)
class Controller:
    """A cascade as robots have it: position P, speed PI, torque limit, one computation delay."""

    sampling_period_s: float = option(1e-3, "Sampling period of the controller [s].", ge=1e-6)
    position_gain_1_s: float = option(6.0, "Gain of the position loop [1/s].", ge=0)
    speed_bandwidth_hz: float = option(20.0, "Crossover of the speed loop on the rotor's inertia alone [Hz].", gt=0)
    integral_time_s: float = option(0.1, "Integral time of the speed loop [s].", gt=0)
    delay_samples: int = option(1, "Samples from measurement to the torque that uses it.", ge=0, le=4)


@dataclass(frozen=True)
class PoseInterface:
    """How the controller takes commands of the tool's pose and reports where it is, beside its own loops."""

    sampling_period_s: float = option(
        0.012, "Time between commands, a whole multiple of the controller's [s].", ge=1e-6
    )
    delay_samples: int = option(1, "Transport delay of the commands, in samples of the interface.", ge=0, le=1_000)
    moving_average: int = option(1, "Samples over which commands are averaged; 1 is none.", ge=1, le=10_000)
    speed_feedforward: float = option(
        0.0, "Share of the commanded motor speed that the speed loops receive.", ge=0, le=1
    )
    resolution_m: float = option(1e-5, "Step of reported positions; 0 for none [m].", ge=0)
    resolution_rad: float = option(
        1.7453292519943296e-5, "Step of reported angles, 0.001 degrees unless given; 0 for none [rad].", ge=0
    )
    noise_m: float = option(0.0, "Standard deviation of the noise of reported positions, before rounding [m].", ge=0)
    noise_rad: float = option(0.0, "Standard deviation of the noise of reported angles, before rounding [rad].", ge=0)
    external_axes: tuple[str, ...] = option(
        (),
        "Prismatic joints that carry the robot's root and have their own commands, the first of the chain. A "
        "single one is the channel R; several have their names.",
    )
    tool_m: tuple[float, float, float] = option((0.0, 0.0, 0.0), "Tool point in the last link's frame [m].")
    tool_abc_deg: tuple[float, float, float] = option(
        (0.0, 0.0, 0.0), "Turns of the tool about the last link's z, its new y and newest x axis [deg]."
    )


@dataclass(frozen=True)
class Imperfections:
    """What the simulated robot does beyond the linear model; zero or false is off."""

    encoder_noise_rad: float = option(0.0, "Standard deviation of the motor angle's noise [rad].", ge=0)
    link_encoder_noise_rad: float = option(0.0, "Standard deviation of the link encoders' noise [rad].", ge=0)
    link_encoder_noise_m: float = option(
        0.0, "Standard deviation of the noise of prismatic joints' arm-side encoders [m].", ge=0
    )
    link_encoder_resolution_rad: float = option(0.0, "Quantisation step of the link encoders' angles [rad].", ge=0)
    link_encoder_resolution_m: float = option(
        0.0, "Quantisation step of prismatic joints' arm-side encoders [m].", ge=0
    )
    link_encoder_lag_s: float = option(
        0.0,
        "Time by which arm-side encoders show positions of before; fractions of a sample are possible [s].",
        ge=0,
    )
    link_encoder_eccentricity_rad: float = option(
        0.0,
        "Amplitude of the error of revolute joints' arm-side encoders over one turn of the arm: they show"
        " `q + e sin(q + phase)` [rad].",
        ge=0,
    )
    link_encoder_eccentricity_phase_rad: float = option(0.0, "Phase of this error [rad].")
    link_encoder_play_rad: float = option(
        0.0,
        "Play between the arm of a revolute joint and the shaft of its arm-side encoder, full width; the shaft"
        " starts in the middle [rad].",
        ge=0,
    )
    tracker_noise_m: float = option(0.0, "Standard deviation of the trackers' noise [m].", ge=0)
    accelerometer_noise_m_s2: float = option(0.0, "Standard deviation of the accelerometers' noise [m/s^2].", ge=0)
    encoder_resolution_rad: float = option(0.0, "Quantisation step of the motor angle [rad].", ge=0)
    torque_noise_nm: float = option(0.0, "Standard deviation of the torque's noise, new each sample [N m].", ge=0)
    resolver_error_rad: float = option(0.0, "Amplitude of the resolver's error [rad].", ge=0)
    resolver_order: int = option(2, "Periods of the resolver's error per motor turn.", ge=1, le=10_000)
    ripple: bool = option(False, "Torque ripple as the robot file gives it.")
    friction: Literal["none", LawName] = option(
        "none",
        "Law of the motor friction inside the integrator. Without memory: `tanh`, which reaches the Coulomb "
        "torque over the Stribeck speed, and `stribeck`, the Stribeck curve.",
    )
    load_friction: float = option(
        0.0,
        "Growth of the motors' Coulomb and breakaway torques with their gear's load, over that load on the motor side.",
        ge=0,
    )
    friction_asymmetry: float = option(
        0.0,
        "Share by which the motors' friction is higher in the positive direction, and lower in the negative one.",
        gt=-1,
        lt=1,
    )
    viscous_drift: float = option(
        1.0,
        "Viscous friction of the motors of a warm robot over that in a campaign's first configuration.",
        gt=0,
    )
    drift_configurations: float = option(
        3.0, "Configurations after which all but 1/e of this drift has passed, exponentially.", gt=0
    )
    second_ripple_nm: float = option(0.0, "Amplitude of a further torque ripple of all motors [N m].", ge=0)
    second_ripple_order: int = option(2, "Periods of the further ripple per motor turn.", ge=1, le=10_000)
    load_damping_1_rad: float = option(
        0.0,
        "Growth of the transmissions' dampers with their deflection, as a share per radian, of prismatic joints per"
        " metre [1/rad].",
        ge=0,
    )
    stiffening_1_rad2: float = option(0.0, "Cubic over linear coefficient of the transmissions [1/rad^2].", ge=0)
    stiffening_1_m2: float = option(0.0, "The same of prismatic joints [1/m^2].", ge=0)
    one_sided: float = option(
        0.0,
        "Share by which transmissions are stiffer than their mean where their deflection, motor less arm, is positive,"
        " and softer where it is negative.",
        gt=-1,
        lt=1,
    )
    backlash_rad: float = option(0.0, "Arm-side backlash of the transmissions [rad].", ge=0)
    backlash_m: float = option(0.0, "Backlash of prismatic joints' transmissions [m].", ge=0)
    hysteresis_nm: float = option(0.0, "Arm-side hysteresis torque of the transmissions [N m].", ge=0)
    hysteresis_n: float = option(0.0, "Hysteresis force of prismatic joints' transmissions [N].", ge=0)
    transmission_error_rad: tuple[float, ...] = option(
        (),
        "Transmission error of revolute joints' gears, arm side: amplitudes of the harmonics 1, 2, ... of a turn of"
        " the joint's own motor [rad].",
    )
    transmission_error_phase_rad: tuple[float, ...] = option(
        (),
        "Phases of these, 0 where none is given. Each joint's are higher by its index, from 0, times 1 rad, so that the"
        " gears of a robot are not in phase [rad].",
    )
    gear_error_rad: float = option(
        0.0, "Amplitude of a further part of the transmission error, of the gears' own wheels, arm side [rad].", ge=0
    )
    gear_error_order: float = option(1.0, "Periods of this part per motor turn; no whole number is needed.", gt=0)
    gear_error_phase_rad: float = option(
        0.0, "Phase of this part; each joint's is higher by its index times 1 rad [rad]."
    )
    unmodelled_payload_kg: float = option(
        0.0, "Payload mass that the model lacks; negative if the model has too much [kg]."
    )


@dataclass(frozen=True, kw_only=True)
class Truth:
    """How the simulated robot differs from the robot file: seeded deviations, and what is stated one by one."""

    spring_factor: float = option(1.0, "Springs and dampers are multiplied log-uniformly by up to this factor.", ge=1)
    damper_factor: float | None = option(None, "Factor of the dampers if it differs from that of the springs.", ge=1)
    keep: tuple[str, ...] = option((), "Names of springs that keep the robot file's values.")
    friction_relative: float = option(0.0, "Friction coefficients deviate uniformly by up to this share.", ge=0, lt=1)
    seed: int = option(1, "Seed of the deviations.", ge=0)
    rotor_inertia_factor: dict[str, float] = field(
        default_factory=dict, metadata={"description": "Factors on rotor inertias, by joint."}
    )
    mass_factor: dict[str, float] = field(
        default_factory=dict,
        metadata={
            "description": "Factors on mass and inertia of a link, by its joint's name, of the `payload` or the `base`;"
            " centres of mass stay."
        },
    )
    inertia_factor: dict[str, float] = field(
        default_factory=dict, metadata={"description": "Further factors on the inertias alone, of the same bodies."}
    )
    mass_relative: tuple[float, float] = option(
        (0.0, 0.0),
        "Mass and inertia of each link, with its split parts, deviate by a random share between these two, each up or"
        " down.",
    )
    couplings: dict[str, dict[str, float]] = field(
        default_factory=dict,
        metadata={
            "description": "Arm turns per turn of another joint's motor, added to those of the robot file, by "
            "joint and by that joint's name."
        },
    )
    counterbalance_nm: dict[str, tuple[float, float]] = field(
        default_factory=dict,
        metadata={
            "description": "Torque on the arm of a revolute joint that the robot file lacks, by joint: "
            "coefficients of the sine and the cosine of its angle [N m]."
        },
    )
    zero_deg: dict[str, float] = field(
        default_factory=dict,
        metadata={"description": "True minus reported angle of revolute joints, by joint: errors of the zero [deg]."},
    )
    late_torque_s: dict[str, float] = field(
        default_factory=dict,
        metadata={
            "description": "Delay of a motor's torque relative to the others, by joint; fractions of a sample "
            "are possible [s]."
        },
    )
    late_angle_s: dict[str, float] = field(
        default_factory=dict,
        metadata={
            "description": "Delay of a motor's angle relative to the others, by joint; fractions of a sample "
            "are possible [s]."
        },
    )
    torque_constant_factor: dict[str, float] = field(
        default_factory=dict,
        metadata={"description": "True over assumed torque constant, by joint: recorded torques are divided by it."},
    )
    reversed_torque: tuple[str, ...] = option((), "Joints whose torques are recorded with the wrong sign.")


@dataclass(frozen=True)
class SimulateOptions:
    """One simulated campaign."""

    imperfections: Imperfections = field(
        default_factory=Imperfections, metadata={"description": "What is not linear or not exact."}
    )
    truth: Truth = field(
        default_factory=Truth, metadata={"description": "How the true robot differs from the robot file."}
    )
    steps_per_sample: int | None = option(
        None, "RK4 steps per controller sample; as many as modes and friction need when not given.", ge=1, le=64
    )
    transient_periods: int = option(
        1,
        "Periods dropped before recording. With one or more the simulation starts in the periodic steady state that "
        "the linearised loop predicts, and only as much is simulated before the record as it needs to settle.",
        ge=0,
        le=10_000,
    )
    measured_pose: Literal["motors", "tool"] = option(
        "motors",
        "Of a `pose_chirp`: the pose from motor encoders and the rigid arm, as controllers report it, or the "
        "true pose of the tool, relative to the carriage of the rail.",
    )
    seed: int = option(1, "Seed of the noise.", ge=0)
