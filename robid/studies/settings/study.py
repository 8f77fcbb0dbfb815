"""Models of the study section of an experiment file."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias, get_args, get_type_hints

from pydantic import Field

from robid.frf.options import EstimateOptions
from robid.frf.residual import EstimatorKind
from robid.models.elastic.fit.options import ElasticOptions, WeightsKind
from robid.robot.parameters import ElasticKind
from robid.settings.base import Name, Section
from robid.studies.settings.fleet import FleetStudy
from robid.studies.settings.oliveira2019 import OliveiraStudy
from robid.studies.settings.steps import StepOptions
from robid.studies.settings.trust import TrustStudy
from robid.studies.settings.turk2018 import TurkStudy
from robid.studies.settings.unit_mistakes import UnitMistakes

PaperFile: TypeAlias = Annotated[
    str | None, Field(description="File with the paper's figures, relative to this one.", min_length=1)
]


class FrfStudy(Section):
    """Estimators against the best linear approximation, and what compensation leaves of the bias."""

    kind: Literal["frf"] = Field(description="What is studied.")
    campaign: Name = Field(description="Name of the simulated campaign whose realizations it divides into groups.")
    group: int = Field(default=4, description="Realizations of one estimate.", ge=2)
    groups_per_task: int = Field(default=5, description="Groups that are simulated at once.", ge=1)
    estimators: tuple[str, ...] | None = Field(
        default=None, description="Values of `estimate.estimator` to compare; all when not given.", min_length=1
    )
    compensations: tuple[str, ...] | None = Field(
        default=None, description="Values of `estimate.compensation` to compare; all when not given.", min_length=1
    )
    reference_estimator: str = Field(
        default="joint", description="Estimator of the best linear approximation, from all realizations of a task."
    )
    references: dict[str, float] = Field(
        default_factory=dict, description="Figures to hold ours against, by their name in summary.json."
    )


class EstimatorChoice(Section):
    """One estimator of the parameters."""

    estimator: EstimatorKind = Field(description="As in a fit.")
    weights: WeightsKind = Field(default="user", description="As `kind` in the weights of a fit.")
    configurations: Literal["all", "best"] = Field(
        default="all", description="All, or the one with the smallest predicted covariance."
    )


class WernholtStudy(Section):
    """Estimators of springs and dampers by the models that they reach from many starts."""

    kind: Literal["wernholt2008"] = Field(description="What is studied.")
    campaign: Name = Field(description="Name of the simulated campaign whose responses are fitted.")
    fit: ElasticOptions = Field(
        default_factory=lambda: ElasticOptions(free=("stiffness", "damping"), correct_torques=False, starts=100),
        description="Options that all estimators share: free parameters, starts, strategy. All starts are random, the"
        " same for all estimators.",
    )
    estimators: dict[Name, EstimatorChoice] = Field(description="What is compared, by name.", min_length=1)
    reference: Name = Field(
        default="lls15u", description="The estimator whose best model the others' parameters are divided by."
    )
    wide: tuple[Name, ...] = Field(default=(), description="Estimators that also start over `wide_decades`.")
    wide_decades: float = Field(default=2.0, description="Spread of these starts [decades].", gt=0)
    plain: bool = Field(
        default=True, description="Whether every start is also fitted with `strategy: plain`, as in the paper."
    )
    starts_per_task: int = Field(default=25, description="Starts that are fitted in one go.", ge=1)
    individuals: tuple[Name, ...] = Field(
        default=(),
        description="Names of further simulated campaigns, one for each individual of the robot, on which estimates"
        " from all configurations are held against the truth.",
    )
    individual_estimators: tuple[Name, ...] = Field(
        default=(),
        description="Estimators that are held against them; all with all configurations when not given.",
    )
    individual_starts: int = Field(
        default=3, description="Starts of each of these fits, the robot file's values the first one.", ge=1
    )
    element: tuple[int, int] = Field(
        default=(1, 1), description="Numbers, from 1, of the output and the input of the response that is drawn."
    )
    paper: PaperFile = None


class ModelChoice(Section):
    """The data of one model of a design study, and what it frees beyond the others."""

    configurations: tuple[Annotated[int, Field(ge=0)], ...] | None = Field(
        default=None, description="Indices, from 0, of the campaigns' configurations; all when not given.", min_length=1
    )
    count: int | None = Field(default=None, description="How many of these are taken; all when not given.", ge=1)
    seed: int = Field(default=1, description="Seed of the draw that takes them.", ge=0)
    low_torque: Name | None = Field(
        default=None,
        description="Name of the joint with whose smallest gravity torques they are taken, not drawn.",
    )
    free: tuple[ElasticKind, ...] = Field(default=(), description="Kinds that it frees beside those of `fit`.")
    fixed: tuple[str, ...] = Field(default=(), description="Parameters that it fixes beside those of `fit`.")


class ZimmermannStudy(Section):
    """Models from few configurations, chosen in different ways, against the model from all of them."""

    kind: Literal["zimmermann2023"] = Field(description="What is studied.")
    estimation: tuple[Name, ...] = Field(
        description="Names of simulated campaigns, one for each individual of the robot, in the same configurations.",
        min_length=1,
    )
    validation: tuple[Name, ...] = Field(
        description="Names of the campaigns that validate: the same individuals and configurations, in this order.",
        min_length=1,
    )
    fit: ElasticOptions = Field(
        default_factory=lambda: ElasticOptions(free=("stiffness", "viscous"), estimator="lls"),
        description="Options that all fits share.",
    )
    models: dict[Name, ModelChoice] = Field(description="The models, by name.", min_length=1)
    axes: tuple[Name, ...] = Field(
        default=("axis_2", "axis_3"),
        description="Joints by whose first resonance, of the motor's own response, the models are judged.",
        min_length=1,
    )
    reference: Name = Field(default="m49", description="The model that has all configurations.")
    optimal: Name = Field(default="opt2", description="The model that has those of `design`.")
    guess: Name = Field(default="guess", description="The model that has those an engineer would choose.")
    nonlinear: Name | None = Field(
        default=None, description="The model whose gears stiffen, which explains the others' springs."
    )
    design: Name = Field(description="The design of the study.")
    steps: StepOptions = Field(
        default_factory=StepOptions, description="Steps that compare the models in the time domain."
    )
    stepped: tuple[Name, ...] = Field(default=(), description="Models that control the steps, the robot file beside.")
    paper: PaperFile = None


class Mistake(Section):
    """One mistake with its size, in the logs, in the robot file that the fit reads, or in what is simulated."""

    cause: str | None = Field(
        default=None, description="The cause that it should be blamed on; none where there is no single one."
    )
    robot: Literal["heavy", "light"] = Field(
        default="heavy", description="Whose robot it is made with: this file's or that of `light`."
    )
    torque_factor: dict[Name, float] = Field(
        default_factory=dict, description="Logs: factors of the torques, by joint; -1 is a wrong sign."
    )
    angle_factor: dict[Name, float] = Field(
        default_factory=dict, description="Logs: factors of the motor angles, by joint; -1 is a wrong sign."
    )
    swapped: tuple[int, int] | None = Field(
        default=None,
        description="Logs: indices, from 0, of two configurations of the estimation that are taken for each other.",
    )
    delay_samples: int = Field(default=0, description="Logs: samples by which the angles come late.", ge=0)
    gear_ratio_factor: dict[Name, float] = Field(
        default_factory=dict, description="Robot file: factors of the gear ratios, by joint."
    )
    without_springs: tuple[str, ...] = Field(default=(), description="Robot file: names of the springs that it lacks.")
    friction_factor: float = Field(
        default=1.0, description="Robot file: factor of the Coulomb and breakaway levels of all motors.", gt=0
    )
    excitation_factor: float = Field(default=1.0, description="Simulation: factor of the excitation.", gt=0)
    imperfections: dict[str, Any] = Field(
        default_factory=dict, description="Simulation: `imperfections` that take the place of the campaigns'."
    )
    truth: dict[str, Any] = Field(
        default_factory=dict, description="Simulation: `truth` that takes the place of the campaigns'."
    )

    @property
    def physics(self) -> dict[str, Any]:
        """What is simulated otherwise than for a sound robot; empty where its record serves."""
        changed: dict[str, Any] = {"imperfections": self.imperfections, "truth": self.truth}
        if self.excitation_factor != 1:
            changed["excitation_factor"] = self.excitation_factor
        return {key: value for key, value in changed.items() if value}


class SeedChoice(Section):
    """Seeds of true robots and noise."""

    first: int = Field(description="The first seed; further ones follow it.", ge=0)
    mistakes: int = Field(default=5, description="Seeds with which each mistake is made, from the first.", ge=1)
    heavy: int = Field(default=40, description="Sound robots of this file.", ge=1)
    light: int = Field(default=10, description="Sound robots of `light`.", ge=0)
    units: int = Field(default=5, description="Seeds with which each log is read in wrong units.", ge=1)
    rough: int = Field(default=20, description="Sound logs of each robot of `units`, their robot files rough.", ge=0)

    def end(self, *, units: bool) -> int:
        """Returns the first seed that is none of them, where a study reads `units`, or not."""
        read = (self.units, self.rough) if units else ()
        return self.first + max(self.mistakes, self.heavy, self.light, *read)


class Seeds(Section):
    """Two disjoint sets of seeds: thresholds are chosen with one, the stated figures come from the other."""

    judge: SeedChoice = Field(description="Those of the stated figures.")
    choose: SeedChoice = Field(description="Those that thresholds are chosen with.")


class MistakesStudy(Section):
    """What grade a fit gets where something is wrong, and what it is blamed on."""

    kind: Literal["mistakes"] = Field(description="What is studied.")
    fit: Name = Field(description="Name of the fit, with a campaign to validate on, both simulated.")
    light: str | None = Field(
        default=None,
        description="Experiment file, relative to this one, of a light robot, with a fit of the same name.",
        min_length=1,
    )
    seeds: Seeds = Field(description="Seeds of the robots.")
    use: Literal["judge", "choose"] = Field(default="judge", description="Which of the seeds are used.")
    mistakes: dict[Name, Mistake] = Field(description="The mistakes, by name.", min_length=1)
    units: UnitMistakes | None = Field(default=None, description="Logs that are read in wrong units.")
    only: Literal["mistakes", "units"] | None = Field(
        default=None, description="What is done alone: `mistakes`, or `units`; both when not given."
    )

    @property
    def makes_mistakes(self) -> bool:
        """Whether `mistakes` are made."""
        return self.only != "units"

    @property
    def reads_units(self) -> bool:
        """Whether `units` is done."""
        return self.units is not None and self.only != "mistakes"

    @property
    def chosen(self) -> SeedChoice:
        """The seeds that are used."""
        return self.seeds.judge if self.use == "judge" else self.seeds.choose


class SeededCase(Section):
    """A machine that is simulated and identified over many seeds, with filters that suit and filters that do not."""

    first_seed: int = Field(default=101, description="The first seed; further ones follow it.", ge=0)
    seeds: int = Field(default=100, description="Number of seeds.", ge=2)
    seeds_per_task: int = Field(default=25, description="Seeds that are simulated at once.", ge=1)
    duration_s: float = Field(default=10.0, description="Length of a record [s].", gt=0)
    resolution_rad: float = Field(default=7.67e-4, description="Quantum of the motor encoders [rad].", ge=0)
    torque_noise_nm: float = Field(default=0.09, description="Deviation of the measured torque's noise [N m].", ge=0)
    good_cut_hz: float = Field(default=20.0, description="Cut-off of the filters that suit [Hz].", gt=0)
    bad_cut_hz: float = Field(default=200.0, description="Cut-off of the filters that do not [Hz].", gt=0)
    drop_deviations: float = Field(
        default=15.0, description="Deviations of the speed's noise below which rows are dropped.", ge=0
    )


class BranchCase(SeededCase):
    """The robot of this file along an exciting Fourier series, with what all seeded cases have."""

    campaign: Name = Field(description="Name of the campaign whose first configuration is the middle of the motion.")
    harmonics: int = Field(default=6, description="Harmonics of the record's length that move each joint.", ge=1)
    range_share: float = Field(
        default=0.8, description="Share of the way from the middle to the joints' limits that is used.", gt=0, le=1
    )
    torque_share: float = Field(default=0.8, description="Share of the torque limits that is used.", gt=0, le=1)
    draws: int = Field(default=40, description="Random series, of which the best conditioned is taken.", ge=1)
    draw_seed: int = Field(default=1, description="Seed of these.", ge=0)


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
    first_seed: int = Field(
        default=101, description="The first seed of robots and noise; further ones follow it.", ge=0
    )
    seeds: int = Field(default=100, description="Number of rigid robots.", ge=1)
    elastic_seeds: int = Field(default=10, description="Number of robots whose joints are elastic.", ge=0)
    seeds_per_task: int = Field(default=5, description="Robots of one task.", ge=1)


class JanotStudy(Section):
    """Least squares on the inverse dynamics, and whether its verdict on itself is right."""

    kind: Literal["janot2009"] = Field(description="What is studied.")
    haptic: SeededCase | None = Field(default=None, description="The paper's one-axis haptic device.")
    branch: BranchCase | None = Field(default=None, description="The robot of this file, a branch of three motors.")
    emps: RealCase | None = Field(
        default=None,
        description="A real axis, with the fits `axis` and `asymmetric`; skipped where its log is not there.",
    )
    tx40: RecordedCase | None = Field(
        default=None, description="A real arm of six axes; skipped where its logs are not there."
    )
    kr300: CoverageCase | None = Field(default=None, description="A simulated arm of six axes.")
    paper: PaperFile = None


Study: TypeAlias = Annotated[
    FrfStudy
    | WernholtStudy
    | ZimmermannStudy
    | MistakesStudy
    | JanotStudy
    | OliveiraStudy
    | TurkStudy
    | TrustStudy
    | FleetStudy,
    Field(discriminator="kind"),
]


def choices(option: Literal["estimator", "compensation"]) -> tuple[str, ...]:
    """Returns the values that an option of the estimate may have; `auto` is one of the others, chosen by the data."""
    hint = get_type_hints(EstimateOptions)[option]
    names = [name for member in (hint, *get_args(hint)) for name in get_args(member)]
    return tuple(name for name in names if isinstance(name, str) and name != "auto")
