"""Studies of several parts, one for each paper: their sections of an experiment file, and their checks."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from robid.models.lpv.settings import LpvFit
from robid.settings.base import Name, Section
from robid.settings.experiment import Campaign, Experiment
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath
from robid.studies.experiments import (
    Count,
    NotNegative,
    Positive,
    Problems,
    Whole,
    campaign_problem,
    family_problem,
    unknown,
)


class PlantsCase(Section):
    """The paper's transfer functions as plants, excited and measured as its robot was."""

    first_seed: Whole = Field(
        101, description="The seed of the tables' noise; further ones, of the coverage, follow it."
    )
    seeds: Whole = Field(100, description="Number of seeds of the coverage; 0 leaves it out.")
    seeds_per_task: Count = Field(25, description="Seeds that are fitted in one go.")
    delay_samples: Whole = Field(4, description="True transport delay, which is estimated.")
    moving_average: Count = Field(4, description="Samples of the commands' moving average, known.")
    noise_resolutions: NotNegative = Field(
        1.0, description="Deviation of the noise before quantising, over the resolution."
    )
    fit_hz: tuple[float, ...] = Field(
        (0.10, 1.04, 5.20), description="Highest frequencies of the chirps that are fitted [Hz].", min_length=1
    )
    validation_hz: Positive = Field(2.08, description="Highest frequency of the chirp that validates [Hz].")
    band_hz: tuple[float, float] = Field((0.01, 5.2), description="Band in which responses and poles are judged [Hz].")
    max_poles: Count = Field(5, description="Poles that are tried at most.")
    max_delay_samples: Whole = Field(10, description="Longest delay that is searched.")


class SyntheticCase(Section):
    """Random plants whose order is to be found."""

    first_seed: Whole = Field(101, description="The first seed; further ones follow it.")
    plants: Count = Field(100, description="Number of plants, one a seed.")
    plants_per_task: Count = Field(10, description="Plants that are identified in one go.")


class CartesianCase(Section):
    """The arm of this file, whose Cartesian channels are identified in simulation."""

    fit: Name = Field(description="Name of the external fit, with a campaign to validate on.")
    homes: Name = Field(description="Name of the simulated campaign of pose commands from several home positions.")


class LoopCase(Section):
    """Real data of a closed position loop."""

    experiment: str = Field(description="Experiment file, relative to this one.", min_length=1)
    fit: Name = Field(description="Name of its external fit.")


class OliveiraStudy(Section):
    """Transfer functions from commanded to actual position, against known plants, a simulated arm and real data."""

    kind: Literal["oliveira2019"] = Field(description="What is studied.")
    plants: PlantsCase | None = Field(None, description="The paper's transfer functions as plants.")
    synthetic: SyntheticCase | None = Field(None, description="Random plants.")
    arm: CartesianCase | None = Field(None, description="A simulated arm on a rail.")
    emps: LoopCase | None = Field(None, description="A real axis in closed loop; skipped where its log is not there.")
    paper: str = Field(description="File with the paper's figures, relative to this one.", min_length=1)


_PLANTS: FieldPath = ("study", "plants")


def check_oliveira2019(study: OliveiraStudy, experiment: Experiment, _robot: RobotFile | None) -> Problems:
    """Yields the field and the message of everything that is wrong with a study of external dynamics."""
    if study.plants is not None:
        yield from _check_plants(study.plants)
    if study.arm is not None:
        yield from _check_arm(experiment, study.arm)


def _check_plants(case: PlantsCase) -> Problems:
    low, high = case.band_hz
    if not 0 < low < high:
        yield (*_PLANTS, "band_hz"), "S399 must rise from a frequency above 0"
    elif high > max(case.fit_hz):
        yield (*_PLANTS, "band_hz"), f"S400 ends beyond the fastest chirp that is fitted, {max(case.fit_hz):g} Hz"
    if case.validation_hz in case.fit_hz:
        yield (*_PLANTS, "validation_hz"), f"S401 {case.validation_hz:g} Hz is fitted; validate on another chirp"
    if len(set(case.fit_hz)) < len(case.fit_hz):
        yield (*_PLANTS, "fit_hz"), "S402 a frequency is there twice"
    if case.delay_samples > case.max_delay_samples:
        message = f"S403 the true delay of {case.delay_samples} samples would not be searched"
        yield (*_PLANTS, "max_delay_samples"), message


def _check_arm(experiment: Experiment, case: CartesianCase) -> Problems:
    field, homes = ("study", "arm"), experiment.campaigns.get(case.homes)
    if problem := family_problem(experiment, case.fit, "external", validated=True):
        yield (*field, "fit"), problem
    if homes is None:
        yield (*field, "homes"), unknown("campaign", case.homes, experiment.campaigns)
    elif not homes.moves_poses or homes.source is None or homes.source.simulate is None:
        yield (*field, "homes"), f"S404 campaign `{case.homes}` does not simulate pose commands"


class KnownStructureCase(Section):
    """Systems of known structure, measured with noise, each in a basis of states of its own."""

    first_seed: Whole = Field(101, description="The first seed; further ones follow it.")
    runs: Count = Field(100, description="Number of systems, one a seed.")
    runs_per_task: Count = Field(10, description="Systems that are identified in one go.")


class RestCase(Section):
    """The model of this file, held against responses at rest."""

    fit: Name = Field(description="Name of the position-dependent fit, with a campaign to validate on.")


class TravelCase(Section):
    """A model while the slide moves."""

    fit: Name = Field(description="Name of the position-dependent fit.")
    uncompensated: Name | None = Field(
        None, description="Name of a fit to responses with friction in them, whose error is printed beside."
    )
    campaign: Name = Field(description="Name of the simulated campaign in which the slide travels.")
    fixed: Name = Field(description="Name of the simulated campaign with the same lines at one position (eq. 20).")


class TurkStudy(Section):
    """Sparse position-dependent models: of known systems, of a simulated ball screw at rest, and while it moves."""

    kind: Literal["turk2018"] = Field(description="What is studied.")
    synthetic: KnownStructureCase | None = Field(None, description="Systems of known structure.")
    local: RestCase | None = Field(None, description="The model of this file at rest.")
    travel: TravelCase | None = Field(None, alias="global", description="A model while the slide moves.")
    paper: str = Field(description="File with the paper's figures, relative to this one.", min_length=1)


def check_turk2018(study: TurkStudy, experiment: Experiment, robot: RobotFile | None) -> Problems:
    """Yields the field and the message of everything that is wrong with a study of position-dependent dynamics."""
    if study.local is not None and (problem := family_problem(experiment, study.local.fit, "lpv", validated=True)):
        yield ("study", "local", "fit"), problem
    if study.travel is not None:
        for key in ("fit", "uncompensated"):
            name = getattr(study.travel, key)
            if name is not None and (problem := family_problem(experiment, name, "lpv", validated=False)):
                yield (*_FIELD, key), problem
        yield from _check_travel(experiment, study.travel, robot)


_ARM = ".arm"
_FIELD: FieldPath = ("study", "global")


def _check_travel(experiment: Experiment, case: TravelCase, robot: RobotFile | None) -> Problems:
    """Yields what is wrong with the campaigns of a travelling slide and with its scheduling parameter."""
    problems = {
        key: campaign_problem(experiment, name) for key, name in (("campaign", case.campaign), ("fixed", case.fixed))
    }
    yield from (((*_FIELD, key), problem) for key, problem in problems.items() if problem)
    if robot is not None and len(robot.joints) != 1:
        yield _FIELD, f"S405 is of a drive of one joint; the robot has {len(robot.joints)}"
    if not problems["campaign"]:
        yield from _moving(experiment, case)
    if not problems["fixed"]:
        yield from _standing(experiment.campaigns[case.fixed], case)


def position_output(scheduling: str) -> str:
    """Returns the output that shows a scheduling parameter, which names a joint or that output itself."""
    return scheduling if scheduling.endswith(_ARM) else scheduling + _ARM


def _moving(experiment: Experiment, case: TravelCase) -> Problems:
    campaign, fit = experiment.campaigns[case.campaign], experiment.fits.get(case.fit)
    field = (*_FIELD, "campaign")
    if not campaign.travels:
        yield field, f"S406 campaign `{case.campaign}` has no `excitation.travel`: nothing moves in it"
    if campaign.periods < 2:
        yield field, f"S407 campaign `{case.campaign}` needs at least 2 periods to tell noise from what repeats"
    if not isinstance(fit, LpvFit):
        return
    if len(fit.scheduling) != 1:
        yield (
            (*_FIELD, "fit"),
            f"S408 fit `{case.fit}` has {len(fit.scheduling)} scheduling parameters; one can move here",
        )
    elif (output := position_output(fit.scheduling[0])) not in campaign.outputs:
        yield field, f"S409 campaign `{case.campaign}` does not record `{output}`: add it to its `outputs`"


def _standing(campaign: Campaign, case: TravelCase) -> Problems:
    field = (*_FIELD, "fixed")
    if not campaign.has_response:
        yield field, f"S410 campaign `{case.fixed}` has no frequency response"
    if min(campaign.realizations, campaign.periods) < 2:
        yield field, f"S411 campaign `{case.fixed}` needs at least 2 realizations and 2 periods to tell its variances"


class SeededCase(Section):
    """A machine that is simulated and identified over many seeds, with filters that suit and filters that do not."""

    first_seed: Whole = Field(101, description="The first seed; further ones follow it.")
    seeds: int = Field(100, description="Number of seeds.", ge=2)
    seeds_per_task: Count = Field(25, description="Seeds that are simulated at once.")
    duration_s: Positive = Field(10.0, description="Length of a record [s].")
    resolution_rad: NotNegative = Field(7.67e-4, description="Quantum of the motor encoders [rad].")
    torque_noise_nm: NotNegative = Field(0.09, description="Deviation of the measured torque's noise [N m].")
    good_cut_hz: Positive = Field(20.0, description="Cut-off of the filters that suit [Hz].")
    bad_cut_hz: Positive = Field(200.0, description="Cut-off of the filters that do not [Hz].")
    drop_deviations: NotNegative = Field(
        15.0, description="Deviations of the speed's noise below which rows are dropped."
    )


class BranchCase(SeededCase):
    """The robot of this file along an exciting Fourier series, with what all seeded cases have."""

    campaign: Name = Field(description="Name of the campaign whose first configuration is the middle of the motion.")
    harmonics: Count = Field(6, description="Harmonics of the record's length that move each joint.")
    range_share: Positive = Field(
        0.8, description="Share of the way from the middle to the joints' limits that is used.", le=1
    )
    torque_share: Positive = Field(0.8, description="Share of the torque limits that is used.", le=1)
    draws: Count = Field(40, description="Random series, of which the best conditioned is taken.")
    draw_seed: Whole = Field(1, description="Seed of these.")


class RealCase(Section):
    """Real data with published values."""

    experiment: str = Field(description="Experiment file, relative to this one.", min_length=1)
    published: str = Field(description="File with the published values, relative to this one.", min_length=1)


class RecordedCase(Section):
    """A recording whose published values the study knows."""

    experiment: str = Field(description="Experiment file, relative to this one.", min_length=1)
    fit: Name = Field(description="Name of its rigid fit.")


class CoverageCase(Section):
    """Simulated records of one experiment, each of another robot of its kind: do intervals hold the truth?"""

    experiment: str = Field(description="Experiment file, relative to this one.", min_length=1)
    campaign: Name = Field(description="Name of its campaign whose trajectories are played.")
    fit: Name = Field(description="Name of its rigid fit, whose options are taken.")
    first_seed: Whole = Field(101, description="The first seed of robots and noise; further ones follow it.")
    seeds: Count = Field(100, description="Number of rigid robots.")
    elastic_seeds: Whole = Field(10, description="Number of robots whose joints are elastic.")
    seeds_per_task: Count = Field(5, description="Robots of one task.")


class JanotStudy(Section):
    """Least squares on the inverse dynamics, and whether its verdict on itself is right."""

    kind: Literal["janot2009"] = Field(description="What is studied.")
    haptic: SeededCase | None = Field(None, description="The paper's one-axis haptic device.")
    branch: BranchCase | None = Field(None, description="The robot of this file, a branch of three motors.")
    emps: RealCase | None = Field(
        None,
        description="A real axis, with the fits `axis` and `asymmetric`; skipped where its log is not there.",
    )
    tx40: RecordedCase | None = Field(None, description="A real arm of six axes; skipped where its logs are not there.")
    kr300: CoverageCase | None = Field(None, description="A simulated arm of six axes.")
    paper: str | None = Field(None, description="File with the paper's figures, relative to this one.", min_length=1)


HAPTIC_PERIOD_S = 240e-6
"""Sampling period of the haptic device [s]."""

_FEWEST_ROWS = 100


def check_janot2009(study: JanotStudy, experiment: Experiment, robot: RobotFile | None) -> Problems:
    """Yields the field and the message of everything that is wrong with a study of robust regression."""
    if study.haptic is not None:
        yield from _check_case(("study", "haptic"), study.haptic, HAPTIC_PERIOD_S)
    if study.branch is None:
        return
    yield from _check_middle(experiment, study.branch)
    if robot is None:
        return
    if robot.controller is None:
        yield ("study", "branch"), "S412 the robot file has no `controller`, in whose loop the branch is recorded"
    else:
        yield from _check_case(("study", "branch"), study.branch, robot.controller.sampling_period_s)


def _check_case(field: FieldPath, case: SeededCase, sampling_period_s: float) -> Problems:
    if case.bad_cut_hz <= case.good_cut_hz:
        yield (*field, "bad_cut_hz"), "S413 the filters that do not suit must pass more than those that do"
    if case.bad_cut_hz >= 0.25 / sampling_period_s:
        yield (
            (*field, "bad_cut_hz"),
            f"S414 must lie below {0.25 / sampling_period_s:g} Hz, a quarter of the sampling rate",
        )
    if 2 * case.good_cut_hz * case.duration_s < _FEWEST_ROWS:
        message = f"S415 filters at {case.good_cut_hz:g} Hz leave fewer than {_FEWEST_ROWS} rows of each joint"
        yield (*field, "duration_s"), message


def _check_middle(experiment: Experiment, case: BranchCase) -> Problems:
    campaign = experiment.campaigns.get(case.campaign)
    if campaign is None:
        yield ("study", "branch", "campaign"), unknown("campaign", case.campaign, experiment.campaigns)
    elif campaign.configurations is None or campaign.configurations.list_rows is None:
        yield ("study", "branch", "campaign"), f"S416 campaign `{case.campaign}` does not list its configurations"
