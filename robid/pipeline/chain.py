"""The stages: what each is called, runs for and leaves behind; what it does is imported when it is asked for."""

from __future__ import annotations

from robid.later import later
from robid.pipeline.stage import Stage, measured_campaigns, periodic_campaigns, responding_campaigns

CHAIN: tuple[Stage, ...] = (
    Stage(
        "design-configs",
        "Chooses the robot configurations to measure.",
        "design",
        later("robid.artifacts.design:DESIGN"),
        owners=lambda experiment: tuple(experiment.designs),
        plan=later("robid.pipeline.plans:design_plan"),
        run=later("robid.pipeline.design_configs:run"),
        phrase=later("robid.pipeline.design_configs:phrase"),
        problem=later("robid.pipeline.plans:design_problem"),
        show=later("robid.pipeline.design_configs:show"),
        told=later("robid.pipeline.design_configs:told"),
    ),
    Stage(
        "design-excitation",
        "Designs what each motor is told to do, within the limits of every configuration.",
        "campaign",
        later("robid.artifacts.excitation:EXCITATION"),
        owners=periodic_campaigns,
        plan=later("robid.pipeline.plans:excitation_plan"),
        run=later("robid.pipeline.design_excitation:run"),
        phrase=later("robid.pipeline.design_excitation:phrase"),
        show=later("robid.pipeline.design_excitation:show"),
    ),
    Stage(
        "simulate-or-acquire",
        "Simulates a campaign in closed loop, or imports it from a log.",
        "campaign",
        later("robid.artifacts.record:RECORD"),
        owners=measured_campaigns,
        plan=later("robid.pipeline.plans:record_plan"),
        run=later("robid.pipeline.simulate_or_acquire:run"),
        phrase=later("robid.pipeline.simulate_or_acquire:phrase"),
        vouched=later("robid.pipeline.plans:truth_is_not_vouched"),
    ),
    Stage(
        "estimate-frf",
        "Estimates frequency responses with their covariance from a record.",
        "campaign",
        later("robid.artifacts.frf:FRF"),
        owners=responding_campaigns,
        plan=later("robid.pipeline.plans:response_plan"),
        run=later("robid.pipeline.estimate_frf:run"),
        phrase=later("robid.pipeline.estimate_frf:phrase"),
        on_request=later("robid.pipeline.plans:nothing_reads_response"),
    ),
    Stage(
        "fit",
        "Fits a model to frequency responses.",
        "fit",
        later("robid.artifacts.model:MODEL"),
        owners=lambda experiment: tuple(experiment.fits),
        plan=later("robid.pipeline.plans:fit_plan"),
        run=later("robid.pipeline.fit:run"),
        phrase=later("robid.pipeline.fit:phrase"),
        problem=later("robid.pipeline.plans:fit_problem"),
        grade=later("robid.pipeline.plans:fit_grade"),
    ),
    Stage(
        "validate",
        "Holds a fitted model against a campaign that its fit never saw.",
        "fit",
        later("robid.artifacts.validation:VALIDATION"),
        owners=lambda experiment: tuple(name for name, fit in experiment.fits.items() if fit.validate_on is not None),
        plan=later("robid.pipeline.plans:validation_plan"),
        run=later("robid.pipeline.validate:run"),
        phrase=later("robid.pipeline.validate:phrase"),
        grade=later("robid.pipeline.plans:read_grade"),
    ),
)


STAGES = (
    *CHAIN,
    Stage(
        "report",
        "Puts everything on one page, and its numbers into summary.json.",
        "experiment",
        None,
        owners=lambda experiment: (experiment.name,),
        plan=later("robid.pipeline.plans:report_plan"),
        run=later("robid.pipeline.report:run"),
        takes_what_is_there=True,
    ),
)
