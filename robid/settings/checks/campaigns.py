"""Campaigns and designs: what a design reads, a simulation's truth, limits that are needed, what needs no robot."""

from __future__ import annotations

from robid.design.configurations.options import DesignWeights
from robid.settings.checks.configurations import configuration_count
from robid.settings.checks.robot import check_springs
from robid.settings.experiment import Campaign, Design, Experiment
from robid.settings.fits import Families, FitSettings
from robid.settings.problems import Found, suggest
from robid.settings.robot import RobotFile
from robid.settings.robot_parts import parameter_names
from robid.settings.sources import SimulateSettings, TruthSettings, with_truth_springs
from robid.settings.yaml import FieldPath
from robid.simulate.options import Imperfections

_BODIES = ("payload", "base")


def check_truth(field: FieldPath, campaign: Campaign, simulate: SimulateSettings, robot: RobotFile) -> Found:
    """Yields names that the robot does not have, factors that none has, and springs that cannot be."""
    truth = simulate.truth
    springs = [spring.name for spring in robot.all_springs]
    for index, name in enumerate(truth.keep):
        if name not in springs:
            yield (*field, "truth", "keep", index), f"S131 there is no spring `{name}`; {suggest(name, springs)}"
    yield from _factors((*field, "truth"), truth, robot)
    yield from _drives((*field, "truth"), truth, robot)
    yield from _springs((*field, "truth", "springs"), truth, robot)
    for key in ("load_friction", "friction_asymmetry"):
        if getattr(simulate.imperfections, key) and simulate.imperfections.friction == "none":
            yield (*field, "imperfections", key), "S139 changes the levels of a friction law: give `friction` too"
    varying = [spring.name for spring in robot.all_springs if spring.place == "transmission" and spring.stiffness_over]
    if simulate.imperfections.one_sided and varying:
        message = (
            f"S516 the stiffness of `{varying[0]}` depends on a joint's position, which `one_sided` does not do beside"
        )
        yield (*field, "imperfections", "one_sided"), message
    yield from _gear_errors((*field, "imperfections"), simulate.imperfections, varying)
    extra = simulate.imperfections.unmodelled_payload_kg
    yield from _payload((*field, "imperfections", "unmodelled_payload_kg"), extra, campaign, robot)


def _gear_errors(field: FieldPath, flaws: Imperfections, varying: list[str]) -> Found:
    """Yields transmission errors beside springs that cannot have them, and phases of harmonics that are not there."""
    for key in ("transmission_error_rad", "gear_error_rad"):
        if getattr(flaws, key) and varying:
            message = (
                f"S630 the stiffness of `{varying[0]}` depends on a joint's position, which transmission errors do not"
                " act beside"
            )
            yield (*field, key), message
    sizes, phases = len(flaws.transmission_error_rad), len(flaws.transmission_error_phase_rad)
    if phases > sizes:
        message = f"S631 has {phases} phases, but `transmission_error_rad` has {sizes} amplitudes"
        yield (*field, "transmission_error_phase_rad"), message


def _factors(field: FieldPath, truth: TruthSettings, robot: RobotFile) -> Found:
    joints = [joint.name for joint in robot.joints]
    own = {"payload": robot.payload, "base": robot.base}
    bodies = [*joints, *(name for name in _BODIES if own[name] is not None)]
    known = dict.fromkeys(("rotor_inertia_factor", "torque_constant_factor"), joints)
    known |= dict.fromkeys(("mass_factor", "inertia_factor"), bodies)
    for key, names in known.items():
        for name, factor in getattr(truth, key).items():
            if name not in names:
                kind = "body" if names is bodies else "joint"
                yield (*field, key, name), f"S132 there is no {kind} `{name}`; {suggest(name, names)}"
            if factor <= 0:
                yield (*field, key, name), f"S133 must be above 0 (found {factor:g})"
    for key in ("late_torque_s", "late_angle_s"):
        for name, late in getattr(truth, key).items():
            if name not in joints:
                yield (*field, key, name), f"S514 there is no joint `{name}`; {suggest(name, joints)}"
            if late < 0:
                yield (*field, key, name), f"S515 must be 0 or above (found {late:g})"
    for index, name in enumerate(truth.reversed_torque):
        if name not in joints:
            yield (*field, "reversed_torque", index), f"S134 there is no joint `{name}`; {suggest(name, joints)}"


def _drives(field: FieldPath, truth: TruthSettings, robot: RobotFile) -> Found:
    joints = [joint.name for joint in robot.joints]
    least, most = truth.mass_relative
    if not 0 <= least <= most < 1:
        message = f"S135 must be two shares below 1, the smaller first (found {least:g}, {most:g})"
        yield (*field, "mass_relative"), message
    for joint, others in truth.couplings.items():
        for name in (joint, *others):
            if name not in joints:
                yield (*field, "couplings", joint), f"S388 there is no joint `{name}`; {suggest(name, joints)}"
        if joint in others:
            yield (*field, "couplings", joint), "S137 a joint's own motor moves it by its gear ratio"
    revolute = [joint for joint in robot.joints if joint.type == "revolute"]
    every = [joint.name for joint in revolute]
    for name in truth.zero_deg:
        if name not in every:
            yield (*field, "zero_deg", name), f"S429 there is no revolute joint `{name}`; {suggest(name, every)}"
    turning = [joint.name for joint in revolute if joint.counterbalance is None]
    for name in truth.counterbalance_nm:
        if name not in turning:
            message = f"S138 there is no revolute joint `{name}` without a counterbalance; {suggest(name, turning)}"
            yield (*field, "counterbalance_nm", name), message


def _springs(field: FieldPath, truth: TruthSettings, robot: RobotFile) -> Found:
    for index, spring in enumerate(truth.springs):
        if spring.place == "transmission":
            message = "S140 every joint has its transmission in the robot file; `spring_factor` changes it"
            yield (*field, index, "place"), message
    own = len(robot.springs)
    for (section, *rest), message in check_springs(with_truth_springs(robot, truth)):
        if section == "springs" and isinstance(rest[0], int) and rest[0] >= own:
            yield (*field, rest[0] - own, *rest[1:]), message


def _payload(field: FieldPath, extra_kg: float, campaign: Campaign, robot: RobotFile) -> Found:
    if extra_kg == 0:
        return
    stated = 0.0 if robot.payload is None else robot.payload.mass_kg
    mass = stated if campaign.payload_kg is None else campaign.payload_kg
    if mass == 0:
        message = "S141 the robot carries no payload whose mass could differ: give the robot file a `payload` with mass"
        yield field, message
    elif mass + extra_kg < 0:
        yield field, f"S142 the payload has {mass:g} kg: no more than that can be missing (found {extra_kg:g})"
    elif mass + extra_kg == 0 and any(spring.place == "payload" for spring in robot.springs):
        yield field, "S143 a payload on springs needs some mass"


_SHOWN_NEEDS = 3
SPEED, TORQUE = "max_speed_rad_s", "max_torque_nm"


def check_limits(experiment: Experiment, robot: RobotFile) -> Found:
    """Yields who needs a limit that is missing; logs alone need none."""
    if not robot.is_complete:
        return
    for name, campaign in experiment.campaigns.items():
        source = campaign.source
        # One that others played is not designed here.
        if not source or campaign.is_arbitrary or source.response is not None:
            continue
        if source.acquire is None or source.acquire.references:
            what = "a simulation needs" if source.simulate else "an excitation must respect"
            yield from missing_limits(("campaigns", name, "source"), what, robot, (SPEED, TORQUE))
    for name, design in experiment.designs.items():
        if design.cost == "travel":
            yield from missing_limits(("designs", name, "cost"), "the time of travel needs", robot, (SPEED,))


def missing_limits(field: FieldPath, what: str, robot: RobotFile, keys: tuple[str, ...]) -> Found:
    """Yields which of these keys of the motors are missing, after who needs them."""
    motors = [(joint.name, joint.motor) for joint in robot.joints if joint.motor is not None]
    lacking = {key: [name for name, motor in motors if getattr(motor, key) is None] for key in keys}
    if any(lacking.values()):
        told = " and ".join(f"`motor.{key}` of {', '.join(names)}" for key, names in lacking.items() if names)
        yield field, f"S144 {what} the robot file's {told}: missing"


def check_without_robot(experiment: Experiment, families: Families) -> Found:
    """Yields what needs the robot file that an experiment does not name; nothing where it names one.

    Where something cannot be without a robot, the file was forgotten: that is told once, and nothing that follows.
    """
    if experiment.robot is not None:
        return
    needs = needs_of_robot(experiment, families)
    if needs:
        more = f" and {len(needs) - _SHOWN_NEEDS} more" if len(needs) > _SHOWN_NEEDS else ""
        told = f"{', '.join(needs[:_SHOWN_NEEDS])}{more}"
        yield ("robot",), f"S147 is missing: name the robot file here. It is needed by {told}"
        return
    for name, campaign in experiment.campaigns.items():
        for below, message in _campaign(campaign):
            yield ("campaigns", name, *below), message


def needs_of_robot(experiment: Experiment, families: Families) -> list[str]:
    """Lists what of an experiment cannot be without a robot file, each with the reason."""
    needs = []
    for name, campaign in experiment.campaigns.items():
        if campaign.source is None:
            needs.append(f"`campaigns.{name}` (without `source`)")
        elif campaign.source.simulate is not None:
            needs.append(f"`campaigns.{name}.source` (a simulation)")
        elif campaign.configurations is not None:
            needs.append(f"`campaigns.{name}.configurations` (joint angles; logs and responses alone go without)")
    needs += [f"`designs.{name}` (a choice of configurations)" for name in experiment.designs]
    wanting = ((name, fit.family) for name, fit in experiment.fits.items() if families[fit.family].needs_robot)
    return [*needs, *(f"`fits.{name}` (family {family})" for name, family in wanting)]


def _campaign(campaign: Campaign) -> Found:
    acquire = None if campaign.source is None else campaign.source.acquire
    if acquire is None:
        return
    if acquire.references and not (acquire.one_shot or campaign.is_arbitrary):
        message = "S148 a match with an excitation designed here needs `robot`: name what drives it under `inputs`"
        yield ("source", "acquire", "references"), message
    if campaign.payload_kg is not None:
        yield ("payload_kg",), "S150 is carried by a `robot`: leave it out"
    if campaign.is_trajectory:
        yield ("excitation",), "S151 a trajectory is designed for a `robot`: import its log as `one_shot`"
    if campaign.estimate.compensation in ("nominal", "silent_lines") or campaign.estimate.friction_fit is not None:
        yield ("estimate", "compensation"), "S152 friction is that of a `robot`: use `compensation: none`"


_EARLIER = ("prior", "between")
"""Settings of a design that name an earlier fit."""


def check_designs(experiment: Experiment, robot: RobotFile | None) -> Found:
    """Yields what is wrong with the designs; what needs the robot is left out without one."""
    for name, design in experiment.designs.items():
        field: FieldPath = ("designs", name)
        yield from _candidates(field, experiment, design)
        for index, kind in enumerate(design.nuisance or ()):
            if kind in design.free:
                yield (*field, "nuisance", index), f"S153 `{kind}` is under `free` already: name each kind once"
        for key in _EARLIER:
            earlier = getattr(design, key)
            if earlier is not None and earlier not in experiment.fits:
                yield (*field, key), f"S154 there is no fit `{earlier}`; {suggest(earlier, experiment.fits)}"
        yield from _predicted(field, experiment, design)
        yield from _fit(field, experiment, design)
        if robot is not None:
            yield from _parameters(field, experiment, design, robot)


def _candidates(field: FieldPath, experiment: Experiment, design: Design) -> Found:
    campaign = experiment.campaigns.get(design.campaign)
    if campaign is None:
        known = experiment.campaigns
        yield (*field, "campaign"), f"S155 there is no campaign `{design.campaign}`; {suggest(design.campaign, known)}"
        return
    unfit = (
        (campaign.is_trajectory, "S156 campaign `{}` plays a trajectory, which tells nothing of springs"),
        (campaign.moves_poses, "S157 campaign `{}` commands poses, which tells nothing of springs"),
        (campaign.travels, "S158 campaign `{}` travels, so it has no responses to choose by"),
    )
    for is_so, told in unfit:
        if is_so:
            yield (*field, "campaign"), f"{told.format(design.campaign)}: name another one"
    if campaign.configurations is None and campaign.is_one_shot:
        message = f"S159 campaign `{design.campaign}` is one shot without configurations to choose from"
        yield (*field, "campaign"), message
        return
    count = configuration_count(experiment, campaign)
    if count is not None and design.count > count:
        message = f"S160 cannot choose {design.count} of the {count} configurations of `{design.campaign}`"
        yield (*field, "count"), message
    if design.information == "measured" and (campaign.source is None or campaign.is_one_shot):
        lacks = "is one shot" if campaign.is_one_shot else "has no `source`"
        message = (
            f"S161 campaign `{design.campaign}` {lacks}, so there are no responses to read: give it one that repeats,"
            " or use `information: assumed`"
        )
        yield (*field, "information"), message
    if design.information == "assumed" and design.weights.mean == "fit":
        message = "S162 a fit's own weights need the responses' covariance: `information: measured`"
        yield (*field, "weights", "mean"), message


def _predicted(field: FieldPath, experiment: Experiment, design: Design) -> Found:
    name, known = design.predict_at, experiment.campaigns
    if name is None:
        return
    if name not in known:
        yield (*field, "predict_at"), f"S605 there is no campaign `{name}`; {suggest(name, known)}"
    elif known[name].configurations is None or known[name].designs:
        message = (
            f"S606 the configurations of campaign `{name}` are not stated: name one with `random`, a list or a grid"
        )
        yield (*field, "predict_at"), message


def _fit(field: FieldPath, experiment: Experiment, design: Design) -> Found:
    if design.fit is None:
        return
    fit = experiment.fits.get(design.fit)
    if fit is None:
        yield (*field, "fit"), f"S163 there is no fit `{design.fit}`; {suggest(design.fit, experiment.fits)}"
    elif fit.designed_for is None:
        yield (*field, "fit"), _other_family(design.fit, fit)
    if design.weights != DesignWeights(mean="fit"):
        message = (
            f"S164 a choice for fit `{design.fit}` needs `weights: {{mean: fit}}` and nothing beside it: the rest comes"
            " from the fit"
        )
        yield (*field, "weights"), message


def _parameters(field: FieldPath, experiment: Experiment, design: Design, robot: RobotFile) -> Found:
    chosen_for = experiment.fits.get(design.fit or "")
    estimated = None if chosen_for is None else chosen_for.designed_for
    known = parameter_names(robot, (*design.free, *design.along(estimated)))
    for index, name in enumerate(design.fixed):
        if name not in known:
            yield (*field, "fixed", index), f"S165 nothing estimates `{name}`; {suggest(name, known)}"
    wanted = [name for name in parameter_names(robot, design.free) if name not in design.fixed]
    for key in _EARLIER:
        yield from _earlier((*field, key), experiment, getattr(design, key) or "", wanted, robot)


def _earlier(field: FieldPath, experiment: Experiment, name: str, wanted: list[str], robot: RobotFile) -> Found:
    fit = experiment.fits.get(name)
    if fit is None:
        return
    if fit.designed_for is None:
        yield field, _other_family(name, fit)
        return
    estimated = [each for each in parameter_names(robot, fit.designed_for) if each not in fit.not_estimated]
    missing = [f"`{each}`" for each in wanted if each not in estimated]
    if missing:
        message = (
            f"S166 fit `{name}` does not estimate {', '.join(missing)}: fix them here, or estimate them there, each for"
            " itself"
        )
        yield field, message


def _other_family(name: str, fit: FitSettings) -> str:
    return f"S167 fit `{name}` is of family `{fit.family}`, but a design knows elastic models only"
