"""The study of rough robot files: its section of an experiment file, and its checks."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from robid.settings.base import Name, Section
from robid.settings.experiment import Experiment
from robid.settings.robot import RobotFile
from robid.studies.experiments import Count, NotNegative, Positive, Problems, Whole, entry
from robid.studies.settings.parts import RecordedCase
from robid.studies.settings.trust import TrustSeedChoice, TrustSeeds


class RoughArm(Section):
    """A kind of arm, of which robots are drawn."""

    robot: str = entry("Robot file, relative to this one; its springs are taken as rigid.", min_length=1)
    home_deg: tuple[float, ...] = entry("Begin and end of all motions [deg].", min_length=1)
    payload_kg: NotNegative = entry("Heaviest payload [kg].")
    payload_com_m: tuple[float, float, float] = entry(
        "Centre of the payload in the last joint's frame, about which it is drawn [m]."
    )
    balanced: Name = entry("Revolute joint on which those robots that have a counterbalance have it.")


class Spread(Section):
    """How true robots differ from the files of their kind: factors are log-uniform, up to these or between two."""

    mass: float = entry("Mass and inertia of each link.", 1.5, ge=1)
    inertia: float = entry("Inertia of each link beside that.", 1.3, ge=1)
    rotor_inertia: float = entry("Rotor inertias.", 1.3, ge=1)
    viscous: float = entry("Viscous coefficient of each motor.", 1.5, ge=1)
    dry: tuple[Positive, Positive] = entry("Coulomb and breakaway torques of each motor over its file's.", (0.1, 0.6))
    dry_width: tuple[Positive, Positive] = entry(
        "Stribeck speed and presliding deflection of each motor over its file's.", (0.3, 1.0)
    )
    balanced_each: Count = entry("One robot in this number has a counterbalance.", 3)
    balance_share: tuple[Positive, Positive] = entry(
        "Share of gravity at the home position that a counterbalance carries, uniform.", (0.3, 0.8)
    )


class FileErrors(Section):
    """How far the file that a fit is given is from the true robot: factors are log-uniform, up to these."""

    small_links: float = entry("Mass and inertia of each link of the outer half of the chain.", 3.0, ge=1)
    large_links: float = entry("Mass and inertia of each other link.", 1.3, ge=1)
    rotor_inertia: float = entry("Rotor inertias.", 1.2, ge=1)
    friction: float = entry("Viscous coefficient, and dry friction, of each motor.", 20.0, ge=1)
    payload_com_m: NotNegative = entry("Distance of the payload's stated centre from the true one [m].", 0.15)


class LogSpread(Section):
    """Sound logs: each range is that of log-uniform draws."""

    encoder_counts: tuple[Positive, Positive] = entry("Counts of a motor turn.", (4096, 65536))
    torque_noise: tuple[Positive, Positive] = entry(
        "Deviation of the recorded torques' noise over the rated torque, each motor by itself.", (0.002, 0.03)
    )
    resolver_error_rad: NotNegative = entry("Amplitude of the resolvers' error [rad].", 5.0e-4)


class MotionSpread(Section):
    """Motions that one kind of fit is fitted to."""

    count: tuple[Count, Count] = entry("Fewest and most motions.", (1, 1))
    duration_s: tuple[Positive, Positive] = entry("Shortest and longest part of each that is logged [s].")
    poor_share: float = entry("Share of the fits whose motions are poor: each joint moves by less.", ge=0, le=1)
    poor_size: tuple[Positive, Positive] = entry(
        "Log-uniform size of a joint's poor motion over that of a rich one, which uses the robot's limits.",
    )


class CutOffNoise(Section):
    """A level of noise."""

    encoder_counts: Positive = entry("Counts of a motor turn.")
    torque_noise: NotNegative = entry("Deviation of the recorded torques' noise over the rated torque.")


class CutOffs(Section):
    """What the automatic cut-off loses against the best constant one."""

    cut_hz: tuple[Positive, ...] = entry("Constant cut-offs that are tried [Hz].", min_length=2)
    noises: dict[Name, CutOffNoise] = entry("Levels of noise of simulated arms, by name.", default_factory=dict)
    logs: dict[Name, RecordedCase] = entry("Real recordings, by name.", default_factory=dict)


class RoughStudy(Section):
    """What rigid fits are worth, and what is said of them, where logs are sound and robot files are rough."""

    kind: Literal["rough"] = entry("What is studied.")
    arms: dict[Name, RoughArm] = entry("The kinds of arms, by name; robots take turns.", min_length=1)
    drawn: Spread = entry("Differences of the true robots.", default_factory=Spread)
    file: FileErrors = entry("Errors of their files.", default_factory=FileErrors)
    logs: LogSpread = entry("Logs of the robots.", default_factory=LogSpread)
    validated: MotionSpread = entry("Motions of fits that a further motion validates.")
    one_motion: MotionSpread = entry("Motions of fits of one motion, without validation.")
    new_motions: Count = entry("New motions of each robot on which the true error is measured.", 3)
    period_s: Positive = entry("Length of a whole motion [s].", 10.0)
    harmonics: int = entry("Harmonics of a motion.", 5, ge=3, le=1_000)
    rated_share: float = entry("Rated over peak torque of the motors.", 0.4, gt=0, le=1)
    band_hz: Positive = entry("Cut-off behind which all errors are measured [Hz].", 10.0)
    robots: Count = entry("Number of robots at least.", 60)
    added: Whole = entry("Robots that are added, up to three times, while too few fits are good or bad.", 20)
    good: Whole = entry("Good fits of each kind at least.", 40)
    bad: Whole = entry("Bad fits of each kind at least.", 15)
    cutoffs: CutOffs | None = entry("The automatic cut-off; left out when not given.", None)
    seeds: TrustSeedChoice = entry("Seeds of the robots.")
    use: Literal["judge", "choose"] = Field("judge", description="Which of the seeds are used.")

    @property
    def chosen(self) -> TrustSeeds:
        """The seeds that are used."""
        return self.seeds.judge if self.use == "judge" else self.seeds.choose

    @property
    def count(self) -> int:
        """Robots of the first round."""
        return self.robots if self.chosen.robots is None else min(self.robots, self.chosen.robots)

    @property
    def further(self) -> int:
        """Robots of each further round; none where the seeds limit their number."""
        return self.added if self.chosen.robots is None else 0


ROUNDS = 3
"""How often robots are added at most."""


def check_rough(study: RoughStudy, _experiment: Experiment, _robot: RobotFile | None) -> Problems:
    """Yields the field and the message of everything that is wrong with a study of rough robot files."""
    for kind in ("validated", "one_motion"):
        motions: MotionSpread = getattr(study, kind)
        if motions.duration_s[1] > study.period_s:
            yield ("study", kind, "duration_s"), f"S432 a whole motion has {study.period_s:g} s only"
    last = {
        name: getattr(study.seeds, name).first + study.robots + ROUNDS * study.added for name in ("judge", "choose")
    }
    if max(study.seeds.judge.first, study.seeds.choose.first) < min(last.values()):
        yield ("study", "seeds"), "S433 the seeds of `judge` and `choose` overlap"
