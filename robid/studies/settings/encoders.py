"""The study of gears with two encoders: its section of an experiment file."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from robid.settings.base import Name, Section
from robid.settings.experiment import Experiment
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import SpringSection
from robid.studies.experiments import Count, Problems, Whole, entry

Range = tuple[float, float]
Share = Annotated[float, Field(ge=0)]


class DrawnGears(Section):
    """What is drawn anew for each robot; ranges are log-uniform but for the lag's."""

    spring_factor: Annotated[float, Field(ge=1)] = entry("Springs and dampers differ by up to this factor.", 1.25)
    friction_relative: Share = entry("Friction coefficients deviate by up to this share.", 0.15)
    mass_relative: Share = entry("Mass and inertia of each link are off by this share, up or down.", 0.03)
    torque_relative: Share = entry("Each torque constant is off by this share, up or down.", 0.02)
    lag_s: Range = entry("Lag of the arms' encoders, uniform [s].", (1e-3, 5e-3))
    hysteresis_nm: Range = entry("Hysteresis torque of the gears [N m].", (100.0, 400.0))
    stiffening_1_rad2: Range = entry("Cubic over linear coefficient of the gears [1/rad^2].", (5e4, 2e5))
    transmission_error_rad: Range = entry(
        "Amplitude of the first harmonic of motor turns; half of it the second.", (1e-5, 6e-5)
    )
    gear_error_rad: Range = entry("Amplitude of the gear's own error [rad].", (1e-5, 5e-5))
    eccentricity_rad: Range = entry("Eccentricity of the arms' encoders [rad].", (1e-5, 1e-4))


class EncodersStudy(Section):
    """Gears of simulated robots from encoders on both sides."""

    kind: Literal["encoders"] = entry("What is studied.")
    campaign: Name = entry("Name of the simulated campaign whose imperfections, outputs and place are used.")
    fit: Name = entry("Name of the fit of family `transmission`, whose options are used.")
    motions: Count = entry("Motions that a fit reads.", 3)
    period_s: Annotated[float, Field(gt=0)] = entry("Length of each motion [s].", 20.0)
    harmonics: Count = entry("Harmonics of each motion.", 8)
    drawn: DrawnGears = entry("What is drawn for each robot.", default_factory=DrawnGears)
    robots: Count = entry("Sound robots that are fitted to all motions.", 60)
    further: Whole = entry("Sound robots beside these in the fleet.", 10)
    doubled: Whole = entry("Robots of the fleet with a gear of twice the lost motion.", 30)
    defective: Whole = entry("Robots with each defect that is on no list.", 10)
    worn_rad: Annotated[float, Field(gt=0)] = entry("Backlash that doubles the lost motion of a gear [rad].", 7.5e-5)
    hinge: SpringSection | None = entry("Compliance behind the link encoder, as in `truth.springs`.", None)
    loose_rad: Annotated[float, Field(gt=0)] = entry("Play of a loose encoder coupling [rad].", 1.5e-4)
    seeds: dict[Literal["judge", "choose"], Whole] = entry("First seeds: everything is chosen with `choose`.")
    use: Literal["judge", "choose"] = entry("Which of them are used.", "judge")


def check_encoders(study: EncodersStudy, experiment: Experiment, _robot: RobotFile | None) -> Problems:
    """Yields the field and the message of everything that is wrong with a study of gears with two encoders."""
    campaign, fit = experiment.campaigns.get(study.campaign), experiment.fits.get(study.fit)
    if campaign is None or campaign.source is None or campaign.source.simulate is None:
        yield ("study", "campaign"), f"S655 there is no simulated campaign `{study.campaign}`"
    elif campaign.configurations is None or campaign.configurations.list_deg is None:
        yield (
            ("study", "campaign"),
            f"S656 the motions begin in the configuration of `{study.campaign}`: give `list_deg`",
        )
    if fit is None or fit.family != "transmission":
        yield ("study", "fit"), f"S657 there is no fit `{study.fit}` of family `transmission`"
