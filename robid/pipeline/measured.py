"""What the campaigns of a run were excited with, and what they reached of the motors' limits, for its page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from robid.artifacts.kinds import RECORD, record_from_artifact
from robid.artifacts.store import read_artifact, read_outline
from robid.design.excitation.excitation import UNITS, CampaignExcitation
from robid.errors import DataError, SettingsError
from robid.frf.frf import Frf
from robid.report.experiment import ExcitationRow, PeakRow
from robid.report.reached import Plane, ReachedRow, reached_section
from robid.report.section import Section
from robid.robot.description import Joint, Robot
from robid.robot.reached import Reached, reached_in, reached_in_all
from robid.robot.regressor.drives import acts_along
from robid.settings.load import LoadedExperiment


def limits_sections(loaded: LoadedExperiment, folder: Path, campaigns: Sequence[str]) -> tuple[Section, ...]:
    """Lays out what some campaigns reached; nothing without a robot or limits, or where it cannot be built.

    A record is read one configuration at a time: memory does not depend on how many there are.
    """
    rows: list[ReachedRow] = []
    planes: list[Plane] = []
    for name in campaigns if loaded.experiment.robot is not None else ():
        try:
            robot = loaded.robot.to_robot(loaded.experiment.campaigns[name].payload_kg)
        except (DataError, SettingsError):
            return ()
        found = _reached(folder / name / "record.h5", robot)
        if found is not None:
            rows += _rows(name, robot, found)
            planes += _planes(name, robot, found)
    order = {row.joint: index for index, row in reversed([*enumerate(rows)])}
    return reached_section(tuple(sorted(rows, key=lambda row: order[row.joint])), tuple(planes))


def _reached(path: Path, robot: Robot) -> Reached | None:
    found = []
    for row in range(read_outline(path, RECORD).n_rows):
        one = reached_in(record_from_artifact(read_artifact(path, RECORD, row=row, leave_out=("reference",))), robot)
        if one is None:
            return None
        found.append(one)
    return reached_in_all(found) if found else None


def _rows(campaign: str, robot: Robot, found: Reached) -> Iterator[ReachedRow]:
    middle, half = 0.5 * (robot.upper + robot.lower), 0.5 * (robot.upper - robot.lower)
    away = np.maximum(np.abs(found.highest - middle), np.abs(found.lowest - middle))
    for index, joint in enumerate(robot.joints):
        motor, unknown, units = joint.motor, float("nan"), _units(joint)
        rated = unknown if motor.rated_torque_nm is None else motor.rated_torque_nm
        sizes = (
            ("speed", units[0], found.speed_rms, found.speed_peak, motor.max_speed_rad_s),
            ("torque", units[1], found.torque_rms, found.torque_peak, motor.max_torque_nm),
        )
        for quantity, unit, rms, peak, limit in sizes:
            if np.isfinite(peak[index]):
                yield ReachedRow(campaign, joint.name, quantity, unit, float(rms[index]), float(peak[index]), limit)
        if np.isfinite([found.torque_rms[index], rated]).all():
            yield ReachedRow(
                campaign, joint.name, "RMS torque", units[1], unknown, float(found.torque_rms[index]), rated
            )
        if np.isfinite([away[index], half[index]]).all():
            factor, unit = (1.0, "m") if joint.type == "prismatic" else (float(np.rad2deg(1.0)), "°")
            ends = factor * float(away[index]), factor * float(half[index])
            yield ReachedRow(campaign, joint.name, "position", unit, unknown, *ends)


def _planes(campaign: str, robot: Robot, found: Reached) -> Iterator[Plane]:
    for joint, hull, points in zip(robot.joints, found.hulls, found.points, strict=True):
        motor = joint.motor
        rated = float("nan") if motor.rated_torque_nm is None else motor.rated_torque_nm
        corners, some = ([(float(speed), float(torque)) for speed, torque in each] for each in (hull, points))
        limits = motor.max_speed_rad_s, motor.max_torque_nm, rated
        yield Plane(campaign, joint.name, tuple(corners), tuple(some), *limits, units=_units(joint))


def _units(joint: Joint) -> tuple[str, str]:
    """Units of the speed and the torque of what drives a joint."""
    return ("m/s", "N") if acts_along(joint) else ("rad/s", "N m")


def excitation_row(
    loaded: LoadedExperiment, campaign: str, content: CampaignExcitation, shape: tuple[int, ...], frf: Frf | None
) -> ExcitationRow:
    """Says what a campaign excites with, from its excitation, the shape of its record, and its response if any."""
    excitation = content.excitation
    low, high = excitation.frequency_hz[[0, -1]].tolist()
    motors = tuple(joint.name for joint in loaded.robot.joints)
    if frf is not None and not loaded.experiment.campaigns[campaign].moves_poses:
        motors = frf.input_names
    # Of the motors' own responses; those across motors have zeros.
    snr_db = None if excitation.plan is None else excitation.plan.snr_db
    worst_snr_db = None if snr_db is None else float(np.diagonal(snr_db, axis1=-2, axis2=-1).min())
    return ExcitationRow(
        campaign=campaign,
        lines=len(excitation.excited_lines),
        low_hz=low,
        high_hz=high,
        duration_s=float(np.prod(shape[:4])) * excitation.period_s,
        rms=tuple(excitation.rms.tolist()) if len(excitation.reference) else (),
        rms_unit=UNITS[excitation.kind],
        peaks=_peaks(content, motors, loaded.robot.slides),
        detection_lines=len(excitation.detection_lines),
        period_s=excitation.period_s,
        crest_factor=float(excitation.crest_factor.max()) if excitation.crest_factor.size else None,
        worst_snr_db=worst_snr_db,
    )


def _peaks(content: CampaignExcitation, names: tuple[str, ...], slides: list[bool]) -> tuple[PeakRow, ...]:
    plan = content.excitation.plan
    if plan is None:
        return ()
    quantities = (
        ("speed", "rad/s", plan.speed_rms, plan.speed_peak, plan.speed_limit),
        ("torque", "N m", plan.torque_rms, plan.torque_peak, plan.torque_limit),
        ("arm excursion", "rad", plan.excursion_rms, plan.excursion_peak, plan.excursion_limit),
    )
    rows = []
    for motor, (name, own) in enumerate(zip(names, slides, strict=True)):
        for quantity, unit, rms, peak, limit in quantities:
            worst = float(peak[:, motor].max()), float(limit[motor]), float(rms[:, motor].max())
            rows.append(PeakRow(name, quantity, "m" if unit == "rad" and own else unit, *worst))
    return tuple(rows)
