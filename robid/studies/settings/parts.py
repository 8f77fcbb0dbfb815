"""Studies of several parts, one for each paper: their sections of an experiment file, and their checks."""

from __future__ import annotations

from typing import Literal

from robid.models.lpv.settings import LpvFit
from robid.settings.base import Name, Section
from robid.settings.experiment import Experiment
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath
from robid.studies.experiments import (
    Count,
    NotNegative,
    Positive,
    Problems,
    Whole,
    campaign_problem,
    entry,
    family_problem,
    unknown,
)


class PlantsCase(Section):
    """The paper's transfer functions as plants, excited and measured as its robot was."""

    first_seed: Whole = entry("The seed of the tables' noise; further ones, of the coverage, follow it.", 101)
    seeds: Whole = entry("Number of seeds of the coverage; 0 leaves it out.", 100)
    seeds_per_task: Count = entry("Seeds fitted in one task.", 25)
    delay_samples: Whole = entry("True transport delay, which is estimated.", 4)
    moving_average: Count = entry("Samples of the commands' moving average, known.", 4)
    noise_resolutions: NotNegative = entry("Deviation of the noise before quantising, over the resolution.", 1.0)
    fit_hz: tuple[float, ...] = entry(
        "Highest frequencies of the chirps that are fitted [Hz].", (0.10, 1.04, 5.20), min_length=1
    )
    validation_hz: Positive = entry("Highest frequency of the chirp that validates [Hz].", 2.08)
    band_hz: tuple[float, float] = entry("Band in which responses and poles are judged [Hz].", (0.01, 5.2))
    max_poles: Count = entry("Largest number of poles to try.", 5)
    max_delay_samples: Whole = entry("Longest delay that is searched.", 10)


class SyntheticCase(Section):
    """Random plants whose order is to be found."""

    first_seed: Whole = entry("The first seed; further ones follow it.", 101)
    plants: Count = entry("Number of plants, one a seed.", 100)
    plants_per_task: Count = entry("Plants identified in one task.", 10)


class CartesianCase(Section):
    """The arm of this file, whose Cartesian channels are identified in simulation."""

    fit: Name = entry("Name of the external fit, with a campaign to validate on.")
    homes: Name = entry("Name of the simulated campaign of pose commands from several home positions.")


class LoopCase(Section):
    """Real data of a closed position loop."""

    experiment: str = entry("Experiment file, relative to this one.", min_length=1)
    fit: Name = entry("Name of its external fit.")


class OliveiraStudy(Section):
    """Transfer functions from commanded to actual position, against known plants, a simulated arm and real data."""

    kind: Literal["oliveira2019"] = entry("What is studied.")
    plants: PlantsCase | None = entry("The paper's transfer functions as plants.", None)
    synthetic: SyntheticCase | None = entry("Random plants.", None)
    arm: CartesianCase | None = entry("A simulated arm on a rail.", None)
    emps: LoopCase | None = entry("A real axis in closed loop; left out without its log.", None)
    paper: str = entry("File with the paper's figures, relative to this one.", min_length=1)


def check_oliveira2019(study: OliveiraStudy, experiment: Experiment, _robot: RobotFile | None) -> Problems:
    """Yields the field and the message of everything that is wrong with a study of external dynamics."""
    if (plants := study.plants) is not None:
        field, (low, high) = ("study", "plants"), plants.band_hz
        if not 0 < low < high:
            yield (*field, "band_hz"), "S399 must rise from a frequency above 0"
        elif high > max(plants.fit_hz):
            yield (*field, "band_hz"), f"S400 ends beyond the fastest chirp that is fitted, {max(plants.fit_hz):g} Hz"
        if plants.validation_hz in plants.fit_hz:
            yield (*field, "validation_hz"), f"S401 {plants.validation_hz:g} Hz is fitted; validate on another chirp"
        if len(set(plants.fit_hz)) < len(plants.fit_hz):
            yield (*field, "fit_hz"), "S402 a frequency is there twice"
        if (delay := plants.delay_samples) > plants.max_delay_samples:
            yield (*field, "max_delay_samples"), f"S403 the true delay of {delay} samples would not be searched"
    if (arm := study.arm) is not None:
        if problem := family_problem(experiment, arm.fit, "external", validated=True):
            yield ("study", "arm", "fit"), problem
        homes, field = experiment.campaigns.get(arm.homes), ("study", "arm")
        if homes is None:
            yield (*field, "homes"), unknown("campaign", arm.homes, experiment.campaigns)
        elif not homes.moves_poses or homes.source is None or homes.source.simulate is None:
            yield (*field, "homes"), f"S404 campaign `{arm.homes}` does not simulate pose commands"


class KnownStructureCase(Section):
    """Systems of known structure, measured with noise, each in a basis of states of its own."""

    first_seed: Whole = entry("The first seed; further ones follow it.", 101)
    runs: Count = entry("Number of systems, one a seed.", 100)
    runs_per_task: Count = entry("Systems identified in one task.", 10)


class RestCase(Section):
    """The model of this file, held against responses at rest."""

    fit: Name = entry("Name of the position-dependent fit, with a campaign to validate on.")


class TravelCase(Section):
    """A model while the slide moves."""

    fit: Name = entry("Name of the position-dependent fit.")
    uncompensated: Name | None = entry(
        "Name of a fit to responses that contain friction, whose error is shown beside.", None
    )
    campaign: Name = entry("Name of the simulated campaign in which the slide travels.")
    fixed: Name = entry("Name of the simulated campaign with the same lines at one position (eq. 20).")


class TurkStudy(Section):
    """Sparse position-dependent models: of known systems, of a simulated ball screw at rest, and while it moves."""

    kind: Literal["turk2018"] = entry("What is studied.")
    synthetic: KnownStructureCase | None = entry("Systems of known structure.", None)
    local: RestCase | None = entry("The model of this file at rest.", None)
    travel: TravelCase | None = entry("A model while the slide moves.", None, alias="global")
    paper: str = entry("File with the paper's figures, relative to this one.", min_length=1)


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
    problems = {key: campaign_problem(experiment, getattr(case, key)) for key in ("campaign", "fixed")}
    yield from (((*_FIELD, key), problem) for key, problem in problems.items() if problem)
    if robot is not None and len(robot.joints) != 1:
        yield _FIELD, f"S405 is of a drive of one joint; the robot has {len(robot.joints)}"
    if not problems["campaign"]:
        yield from _moving(experiment, case)
    if not problems["fixed"]:
        fixed, field = experiment.campaigns[case.fixed], (*_FIELD, "fixed")
        if not fixed.has_response:
            yield field, f"S410 campaign `{case.fixed}` has no frequency response"
        if min(fixed.realizations, fixed.periods) < 2:
            needs = "needs at least 2 realizations and 2 periods to tell its variances"
            yield field, f"S411 campaign `{case.fixed}` {needs}"


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
        count = len(fit.scheduling)
        yield (*_FIELD, "fit"), f"S408 fit `{case.fit}` has {count} scheduling parameters; one can move here"
    elif (output := position_output(fit.scheduling[0])) not in campaign.outputs:
        yield field, f"S409 campaign `{case.campaign}` does not record `{output}`: add it to its `outputs`"


class SeededCase(Section):
    """A machine that is simulated and identified over many seeds, with filters that suit and filters that do not."""

    first_seed: Whole = entry("The first seed; further ones follow it.", 101)
    seeds: int = entry("Number of seeds.", 100, ge=2, le=1_000_000)
    seeds_per_task: Count = entry("Seeds that are simulated at once.", 25)
    duration_s: Positive = entry("Length of a record [s].", 10.0)
    resolution_rad: NotNegative = entry("Quantum of the motor encoders [rad].", 7.67e-4)
    torque_noise_nm: NotNegative = entry("Deviation of the measured torque's noise [N m].", 0.09)
    good_cut_hz: Positive = entry("Cut-off of the good filters [Hz].", 20.0)
    bad_cut_hz: Positive = entry("Cut-off of the bad filters [Hz].", 200.0)
    drop_deviations: NotNegative = entry("Deviations of the speed's noise below which rows are dropped.", 15.0)


class BranchCase(SeededCase):
    """The robot of this file along an exciting Fourier series, with what all seeded cases have."""

    campaign: Name = entry("Name of the campaign whose first configuration is the middle of the motion.")
    harmonics: Count = entry("Harmonics of the record's length that move each joint.", 6)
    range_share: Positive = entry("Share of the way from the middle to the joints' limits that is used.", 0.8, le=1)
    torque_share: Positive = entry("Share of the torque limits that is used.", 0.8, le=1)
    draws: Count = entry("Random series, of which the best conditioned is taken.", 40)
    draw_seed: Whole = entry("Seed of these.", 1)


class RealCase(Section):
    """Real data with published values."""

    experiment: str = entry("Experiment file, relative to this one.", min_length=1)
    published: str = entry("File with the published values, relative to this one.", min_length=1)


class RecordedCase(Section):
    """A recording whose published values the study knows."""

    experiment: str = entry("Experiment file, relative to this one.", min_length=1)
    fit: Name = entry("Name of its rigid fit.")


class CoverageCase(Section):
    """Simulated records of one experiment, each of another robot of its kind: do intervals hold the truth?"""

    experiment: str = entry("Experiment file, relative to this one.", min_length=1)
    campaign: Name = entry("Name of its campaign whose trajectories are played.")
    fit: Name = entry("Name of its rigid fit, whose options are taken.")
    first_seed: Whole = entry("The first seed of robots and noise; further ones follow it.", 101)
    seeds: Count = entry("Number of rigid robots.", 100)
    elastic_seeds: Whole = entry("Number of robots whose joints are elastic.", 10)
    seeds_per_task: Count = entry("Robots of one task.", 5)


class JanotStudy(Section):
    """Least squares on the inverse dynamics, and whether its verdict on itself is right."""

    kind: Literal["janot2009"] = entry("What is studied.")
    haptic: SeededCase | None = entry("The paper's one-axis haptic device.", None)
    branch: BranchCase | None = entry("The robot of this file, a branch of three motors.", None)
    emps: RealCase | None = entry("A real axis, with the fits `axis` and `asymmetric`; left out without its log.", None)
    tx40: RecordedCase | None = entry("A real arm of six axes; left out without its logs.", None)
    kr300: CoverageCase | None = entry("A simulated arm of six axes.", None)
    paper: str | None = entry("File with the paper's figures, relative to this one.", None, min_length=1)


HAPTIC_PERIOD_S = 240e-6  # Sampling period of the haptic device [s]

_FEWEST_ROWS = 100


def check_janot2009(study: JanotStudy, experiment: Experiment, robot: RobotFile | None) -> Problems:
    """Yields the field and the message of everything that is wrong with a study of robust regression."""
    if study.haptic is not None:
        yield from _check_case(("study", "haptic"), study.haptic, HAPTIC_PERIOD_S)
    if (branch := study.branch) is None:
        return
    campaign, field = experiment.campaigns.get(branch.campaign), ("study", "branch")
    if campaign is None:
        yield (*field, "campaign"), unknown("campaign", branch.campaign, experiment.campaigns)
    elif campaign.configurations is None or campaign.configurations.list_rows is None:
        yield (*field, "campaign"), f"S416 campaign `{branch.campaign}` does not list its configurations"
    if robot is not None and robot.controller is None:
        yield field, "S412 the robot file has no `controller`, in whose loop the branch is recorded"
    elif robot is not None and robot.controller is not None:
        yield from _check_case(field, branch, robot.controller.sampling_period_s)


def _check_case(field: FieldPath, case: SeededCase, sampling_period_s: float) -> Problems:
    if case.bad_cut_hz <= case.good_cut_hz:
        yield (*field, "bad_cut_hz"), "S413 the filters that do not suit must pass more than those that do"
    if case.bad_cut_hz >= (highest := 0.25 / sampling_period_s):
        yield (*field, "bad_cut_hz"), f"S414 must lie below {highest:g} Hz, a quarter of the sampling rate"
    if 2 * case.good_cut_hz * case.duration_s < _FEWEST_ROWS:
        rows = f"fewer than {_FEWEST_ROWS} rows of each joint"
        yield (*field, "duration_s"), f"S415 filters at {case.good_cut_hz:g} Hz leave {rows}"
