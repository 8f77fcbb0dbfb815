"""Measured logs against the robot: names, numbers, units of joints that turn or slide, what fits hand on."""

from __future__ import annotations

import string
from collections.abc import Iterator, Mapping, Sequence

from robid.settings.base import DATA_VARIABLE
from robid.settings.experiment import Campaign, Experiment
from robid.settings.fits import HandedOn
from robid.settings.problems import Found, suggest
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import JointSection
from robid.settings.sources import PLACES, WIDTH, Acquire, is_numbered
from robid.settings.yaml import FieldPath
from robid.signals.log_channels import LogChannel, OutputChannel, input_problems
from robid.signals.quantities import DRIVES, INJECTED, MOTOR_TORQUE, UNITS, units_of

_TURNS = {"N m": "torque", "rad": "angle", "rad/s": "speed", "rad/s^2": "acceleration"}
_SLIDES = {"N": "force", "m": "position", "m/s": "speed", "m/s^2": "acceleration"}
_TO_SLIDE = dict(zip(_TURNS, _SLIDES, strict=True))
_TO_TURN = dict(zip(_SLIDES, _TURNS, strict=True))


def wrong_kinds(groups: Mapping[str, Sequence[LogChannel]], robot: RobotFile) -> Found:
    """Yields channels of joints whose unit or side is not one of their joint, below the log's section.

    What is measured at the tool may be anything, and so may a second sensor of a joint, which has a name of its own.
    """
    joints = {joint.name: joint for joint in robot.joints}
    for key, channels in groups.items():
        for index, channel in enumerate(channels):
            joint = joints.get(channel.name.removesuffix(".arm"))
            side = None if joint is None else _wrong_side(channel, joint)
            if side and not (key == "outputs" and channel.name.endswith(".arm")):
                yield (key, index, "side"), side
            if joint is None or channel.channel.side == "tool" or channel.problems():
                continue
            message = _wrong_kind(channel, joint)
            if message:
                yield (key, index, "unit"), message


def _wrong_side(channel: LogChannel, joint: JointSection) -> str:
    """Says why a channel cannot be of the side that is stated; those of outputs' names are checked with their names."""
    if channel.name.endswith(".arm") and channel.side not in (None, "arm"):
        return f"S204 `{channel.name}` is the arm side of `{joint.name}`: leave `side` out"
    if channel.side == "motor" and not joint.has_motor:
        told = "has no motor (`torque_measured_at: joint`): leave `side` out, all of it is the arm's"
        return f"S205 `{joint.name}` {told}"
    return ""


def _wrong_kind(channel: LogChannel, joint: JointSection) -> str:
    unit, name = channel.si_unit, joint.name
    is_arm = channel.channel.side == "arm"
    if unit == "A":
        told = f"`{channel.variable}` is a current, but `{name}` has no motor (`torque_measured_at: joint`)"
        own = _TO_SLIDE["N m"] if joint.slides else "N m"
        return "" if joint.has_motor else f"S206 {told}: state what its sensor shows, in {_units(own)}"
    as_arm = joint.slides and is_arm
    # A linear motor's own units are those of what it moves: its ratio is 1, whichever way it goes.
    either = joint.slides and not is_arm and joint.motor is not None and abs(joint.motor.ratio or 0.0) == 1
    if either or unit in (_SLIDES if as_arm else _TURNS):
        return ""
    wanted = _TO_SLIDE[unit] if as_arm else _TO_TURN[unit]
    quantity = {**_TURNS, **_SLIDES}[wanted]
    of = "turn" if channel.counts_per_turn is not None else "length"
    counted = f" of a {of}" if channel.unit.startswith("counts") else ""
    start = f"`{channel.variable}` is in {channel.unit}{counted}, but "
    if not joint.slides:
        told = f"its {quantity} is in {_units(wanted)} (or `side: tool`, measured there)"
        return f"S207 {start}`{name}` is revolute: {told}"
    if is_arm:
        return f"S208 {start}`{name}` is prismatic: its arm's {quantity} is in {_units(wanted)}"
    own = f"its motor's {quantity} is in {_units(wanted)}"
    return f"S209 {start}`{name}` is prismatic and its motor turns: {own}; what its slide does is named `{name}.arm`"


def _units(unit: str) -> str:
    names = [name for name, known in UNITS.items() if known.si == unit]
    return f"{', '.join(names[:-1])} or {names[-1]}" if len(names) > 1 else names[0]


_WHAT: Mapping[HandedOn, str] = {
    "friction": "Coulomb friction: name one of family `rigid` with `model: {friction: coulomb}` or `asymmetric`",
    "standard": "masses and inertias: name one of family `rigid` with `physical: true`",
    "gears": "springs of gears: name one of family `transmission`",
}
_KEYS: Mapping[HandedOn, str] = {"standard": "rigid", "gears": "springs_from"}


def check_handed_on(experiment: Experiment) -> Found:
    """Yields fits that are named but are not there, or do not hand on what is wanted of them."""
    for name, campaign in experiment.campaigns.items():
        wanted = campaign.estimate.friction_fit
        if wanted is not None:
            yield from _named(experiment, ("campaigns", name, "estimate", "compensation", "fit"), wanted, "friction")
    for name, fit in experiment.fits.items():
        for what, other in fit.takes.items():
            yield from _named(experiment, ("fits", name, _KEYS.get(what, what)), other, what)


def _named(experiment: Experiment, field: FieldPath, name: str, what: HandedOn) -> Found:
    fit = experiment.fits.get(name)
    if fit is None:
        yield field, f"S210 there is no fit `{name}`; {suggest(name, experiment.fits)}"
    elif what not in fit.hands_on:
        yield field, f"S211 fit `{name}` of family `{fit.family}` hands on no {_WHAT[what]}"


def check_logs(field: FieldPath, campaign: Campaign, acquire: Acquire, n_configuration: int | None) -> Found:
    """Finds what is wrong with a campaign's logs whatever the robot is; its number of configurations may be unknown."""
    inside = (*field, "source", "acquire")
    n_experiment = campaign.experiments or 1 if acquire.one_shot else campaign.block_size(len(acquire.inputs))
    yield from _signal(field, campaign, acquire)
    counts = {"configuration": n_configuration or 1, "realization": campaign.realizations, "experiment": n_experiment}
    variables = [one.variable for one in acquire.channels if one.file is None]
    yield from _file((*inside, "file"), acquire.file, counts, variables)
    if acquire.one_shot:
        if n_configuration not in (None, 1):
            message = "S212 one shot begins in one configuration; state repeated shots as realizations"
            yield (*field, "configurations"), message
        if acquire.drop_periods:
            yield (*inside, "drop_periods"), "S213 one shot has no periods"
    if acquire.to_s is not None and acquire.to_s <= acquire.from_s:
        yield (*inside, "to_s"), f"S214 {acquire.to_s:g} is not above from_s {acquire.from_s:g}"
    if acquire.resample == "time" and acquire.time is None:
        yield (*inside, "resample"), "S215 there is no `time` to resample to"
    if acquire.resample == "period" and (acquire.one_shot or campaign.is_arbitrary):
        kind = "one shot" if acquire.one_shot else "an arbitrary signal"
        yield (*inside, "resample"), f"S216 {kind} has no period to resample to: leave it out, or resample to `time`"
    yield from _channels(inside, acquire, counts)
    known = units_of(INJECTED[campaign.excitation.inject], rotation=True)
    for index, reference in enumerate(acquire.references):
        if reference.unit not in known and not (acquire.one_shot or campaign.is_arbitrary):
            message = f"S219 {reference.unit} is no unit of a {campaign.excitation.inject}: use {' or '.join(known)}"
            yield (*inside, "references", index, "unit"), message
    for problem in input_problems(acquire.inputs):
        yield (*inside, "inputs"), problem
    for key, problem in acquire.pose_problems():
        yield (*inside, key), problem
    yield from _compensation(field, campaign, acquire)


def _channels(inside: FieldPath, acquire: Acquire, counts: dict[str, int]) -> Found:
    for key, channels in acquire.groups.items():
        names = [channel.name for channel in channels]
        for index, channel in enumerate(channels):
            if channel.name in names[:index]:
                yield (*inside, key, index, "name"), f"S217 `{channel.name}` is there twice"
            if channel.time is not None and acquire.time is None:
                message = "S218 state `time` below `acquire` too: all channels are brought to one clock, in its unit"
                yield (*inside, key, index, "time"), message
            if channel.file is not None:
                yield from _file((*inside, key, index, "file"), channel.file, counts, [channel.variable])
            for problem in channel.problems():
                yield (*inside, key, index), problem


def _compensation(field: FieldPath, campaign: Campaign, acquire: Acquire) -> Found:
    """Finds friction that is subtracted from what is no torque."""
    if campaign.estimate.compensation == "nominal" and any(channel.normalised for channel in acquire.inputs):
        message = "S220 friction in N m cannot be subtracted from a normalised current: use `compensation: none`"
        yield (*field, "estimate", "compensation"), message
    sound = [one.channel for one in acquire.inputs if not one.problems()]
    others = [one.title for one in sound if not MOTOR_TORQUE.accepts([one])]
    if others and campaign.estimate.compensation_kind in ("nominal", "silent_lines", "fit"):
        message = f"S221 friction is subtracted from motor torques, not from a {others[0]}: use `compensation: none`"
        yield (*field, "estimate", "compensation"), message


def _signal(field: FieldPath, campaign: Campaign, acquire: Acquire) -> Found:
    """Finds what logs of an arbitrary signal, or whose lines are to be found, cannot have."""
    inside, estimate = (*field, "source", "acquire"), campaign.estimate
    if campaign.finds_lines and acquire.references:
        message = "S222 `found` is for signals that others have played; one designed here has the lines it was given"
        yield (*field, "excitation", "lines"), message
    if not campaign.is_arbitrary:
        return
    if acquire.one_shot:
        message = "S223 an arbitrary signal is for responses, one shot for records: leave one of them out"
        yield (*inside, "one_shot"), message
    if acquire.drop_periods:
        message = "S224 an arbitrary signal has no periods: use `from_s` and `to_s`, or leave it out"
        yield (*inside, "drop_periods"), message
    if "periods" in campaign.model_fields_set:
        yield (*field, "periods"), "S225 an arbitrary signal has no periods, all of its log is used: leave it out"
    if estimate.estimator != "local":
        yield (*field, "estimate", "estimator"), "S226 an arbitrary signal is read by `local`: leave it out"
    if estimate.compensation_kind == "silent_lines":
        message = "S227 an arbitrary signal leaves no line silent: use `compensation: nominal` or `none`"
        yield (*field, "estimate", "compensation"), message
    if acquire.references and [one.name for one in acquire.references] != [one.name for one in acquire.inputs]:
        yield (*inside, "references"), "S228 must be those of the inputs, with their names, in their order"


def check_channels(field: FieldPath, campaign: Campaign, acquire: Acquire, robot: RobotFile) -> Found:
    """Finds channels that are not those of the robot, and what a match with its excitation lacks."""
    inside = (*field, "source", "acquire")
    joints = [joint.name for joint in robot.joints]
    driving = [one for one in acquire.inputs if not one.problems() and one.channel.quantity in DRIVES]
    named: list[tuple[str, tuple[LogChannel, ...]]] = []
    if not acquire.one_shot:
        named.append(("references", acquire.references))
    if len(driving) == len(acquire.inputs):
        named.append(("inputs", acquire.inputs))
    for key, channels in named:
        if channels and [channel.name for channel in channels] != joints:
            message = f"S229 must be one channel per joint, named in this order: {', '.join(joints)}"
            yield (*inside, key), f"S230 {message} (`{joints[0]}.arm` where it is one of the arm side)"
    for index, output in enumerate(acquire.outputs):
        for key, problem in check_outputs(output, joints):
            yield (*inside, "outputs", index, key), problem
    for place, problem in wrong_kinds(acquire.groups, robot):
        yield (*inside, *place), problem
    if not acquire.references or acquire.one_shot or campaign.is_arbitrary:
        return
    if robot.controller is None:
        message = "S231 the excitation is designed for the robot file's `controller`, which is missing"
        yield (*inside, "references"), message
    elif abs(robot.controller.sampling_period_s / acquire.sampling_period_s - 1) > 1e-9:
        told = f"{robot.controller.sampling_period_s:g} s, to be matched to its excitation"
        yield (*inside, "sampling_period_s"), f"S232 must be the controller's, {told}"


def check_outputs(output: OutputChannel, joints: list[str]) -> Iterator[tuple[str, str]]:
    """Yields what is wrong with an output's name and side, by the setting."""
    joint, _, part = output.name.partition(".")
    unsaid = part not in ("", "arm") and output.channel.quantity == "angle" and output.quantity is None
    if output.side != "tool" and (joint not in joints or unsaid):
        known = [*joints, *(f"{name}.arm" for name in joints)]
        yield "name", f"S358 `{output.name}` is not an angle of the robot; {suggest(output.name, known)}"
    own = {"": "motor", "arm": "arm"}.get(part)
    if joint in joints and own is not None and output.side not in (None, own):
        yield "side", f"S359 `{output.name}` is the {own} side of `{joint}`: leave `side` out, or give it another name"


def _file(field: FieldPath, file: str, counts: dict[str, int], variables: list[str]) -> Found:
    """Finds numbers that a path cannot hold, and several logs under one name that share their variables."""
    rest = file.removeprefix(DATA_VARIABLE)
    if "$" in rest:
        yield field, f"S233 only `{DATA_VARIABLE}`, at the start, is replaced in a path"
        return
    try:
        found = [(name, kind, how) for _, name, kind, how in string.Formatter().parse(rest) if name is not None]
    except ValueError:
        found = [("", "", None)]
    used = {name for name, _, _ in found}
    # No attributes of a number, and no width of a million digits.
    if not used <= {*PLACES} or any(how or not WIDTH.fullmatch(kind or "") for _, kind, how in found):
        yield field, f"S234 only {', '.join(f'`{{{name}}}`' for name in PLACES)} stand for numbers in a path"
        return
    for name, count in counts.items():
        if count > 1 and name not in used and not (variables and all(is_numbered(one, name) for one in variables)):
            message = f"there is one log for each of {count} {name}s: put `{{{name}}}` into its name"
            yield field, f"S235 {message}, or into those of all its variables"
