"""The stages: what each is called, runs for and leaves behind; what it does is imported when it is asked for."""

from __future__ import annotations

from robid.later import later
from robid.pipeline.stage import Stage, measured_campaigns, periodic_campaigns, responding_campaigns

with later(__name__):
    from robid.artifacts.kinds import DESIGN, EXCITATION, FRF, RECORD
    from robid.artifacts.results import MODEL, VALIDATION
    from robid.pipeline.design_configs import phrase as phrase_design_configs
    from robid.pipeline.design_configs import run as run_design_configs
    from robid.pipeline.design_configs import show as show_design_configs
    from robid.pipeline.design_configs import told as told_design_configs
    from robid.pipeline.design_excitation import phrase as phrase_design_excitation
    from robid.pipeline.design_excitation import run as run_design_excitation
    from robid.pipeline.design_excitation import show as show_design_excitation
    from robid.pipeline.estimate_frf import phrase as phrase_estimate_frf
    from robid.pipeline.estimate_frf import run as run_estimate_frf
    from robid.pipeline.fit import phrase as phrase_fit
    from robid.pipeline.fit import run as run_fit
    from robid.pipeline.plans import (
        design_plan,
        design_problem,
        excitation_plan,
        fit_grade,
        fit_plan,
        fit_problem,
        nothing_reads_response,
        record_plan,
        report_plan,
        response_plan,
        truth_is_not_vouched,
        validation_grade,
        validation_plan,
    )
    from robid.pipeline.report import run as run_report
    from robid.pipeline.simulate_or_acquire import phrase as phrase_simulate_or_acquire
    from robid.pipeline.simulate_or_acquire import run as run_simulate_or_acquire
    from robid.pipeline.validate import phrase as phrase_validate
    from robid.pipeline.validate import run as run_validate

CHAIN: tuple[Stage, ...] = (
    Stage(
        "design-configs",
        "Chooses the robot configurations to measure.",
        "design",
        DESIGN,
        owners=lambda experiment: tuple(experiment.designs),
        plan=design_plan,
        run=run_design_configs,
        phrase=phrase_design_configs,
        problem=design_problem,
        show=show_design_configs,
        told=told_design_configs,
    ),
    Stage(
        "design-excitation",
        "Designs what each motor is commanded to do, within the limits of every configuration.",
        "campaign",
        EXCITATION,
        owners=periodic_campaigns,
        plan=excitation_plan,
        run=run_design_excitation,
        phrase=phrase_design_excitation,
        show=show_design_excitation,
    ),
    Stage(
        "simulate-or-acquire",
        "Simulates a campaign in closed loop, or imports it from a log.",
        "campaign",
        RECORD,
        owners=measured_campaigns,
        plan=record_plan,
        run=run_simulate_or_acquire,
        phrase=phrase_simulate_or_acquire,
        vouched=truth_is_not_vouched,
    ),
    Stage(
        "estimate-frf",
        "Estimates frequency responses with their covariance from a record.",
        "campaign",
        FRF,
        owners=responding_campaigns,
        plan=response_plan,
        run=run_estimate_frf,
        phrase=phrase_estimate_frf,
        on_request=nothing_reads_response,
    ),
    Stage(
        "fit",
        "Fits a model to frequency responses.",
        "fit",
        MODEL,
        owners=lambda experiment: tuple(experiment.fits),
        plan=fit_plan,
        run=run_fit,
        phrase=phrase_fit,
        problem=fit_problem,
        grade=fit_grade,
    ),
    Stage(
        "validate",
        "Compares a fitted model with a campaign that its fit never saw.",
        "fit",
        VALIDATION,
        owners=lambda experiment: tuple(name for name, fit in experiment.fits.items() if fit.validate_on is not None),
        plan=validation_plan,
        run=run_validate,
        phrase=phrase_validate,
        grade=validation_grade,
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
        plan=lambda loaded, owner: report_plan(CHAIN, loaded, owner),
        run=lambda job: run_report(CHAIN, job),
        takes_what_is_there=True,
    ),
)
