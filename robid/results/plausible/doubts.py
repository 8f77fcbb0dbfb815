"""Plausibility: what of data cannot be, each with its likely cause."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.frf.frf import Frf
from robid.frf.quality import FEW_SAMPLES, DrivingPoints, undeclared_delay
from robid.results.doubt import Doubt, saturation_doubts, two_digits
from robid.results.plausible.angles import judge_angles
from robid.results.plausible.carrier import Fitted
from robid.results.plausible.evidence import CLEAR, Evidence, gather_evidence
from robid.results.plausible.gravity import gravity_signs, judge_gravity, judge_places, weigh
from robid.results.plausible.scales import judge_scales
from robid.results.plausible.signs import judge_signs
from robid.robot.description import Robot

_LOST = 2.0
_HALF_TURN = 0.5


def data_doubts(robot: Robot, frf: Frf, delay_s: float = 0.0, fitted: Fitted | None = None) -> tuple[Doubt, ...]:
    """Returns what of a campaign's data contradicts the robot file, before any fit: a wrong scale, then the strongest.

    Args:
        robot: The robot file's, with the campaign's payload.
        frf: The campaign's response.
        delay_s: Nominal delay from recorded to applied torque, hold excluded [s].
        fitted: What a fit found of it that mean torques are held against instead.
    """
    return evidence_doubts(robot, gather_evidence(frf), delay_s, fitted)[0]


def evidence_doubts(
    robot: Robot, evidence: Evidence, delay_s: float = 0.0, fitted: Fitted | None = None
) -> tuple[tuple[Doubt, ...], tuple[str, ...]]:
    """Returns doubts about a campaign's data and notes on what its data cannot tell.

    A wrong scale spoils all the rest: it comes first, and the rest is judged as if it were right.
    """
    if not evidence.belongs_to(robot):
        return (), ()
    scales = judge_scales(robot, evidence, delay_s)
    evidence, late = _without_delay(scales.evidence, delay_s)
    angles = judge_angles(robot, evidence)
    weights = weigh(robot, evidence, angles.ratio_fits, fitted) if angles.placed else None
    none: FloatArray = np.zeros(len(evidence.names))
    signs = judge_signs(robot, evidence, angles.sign, none)
    loads: tuple[Doubt, ...] = ()
    carrying = robot if fitted is None else fitted.found.robot
    if weights is not None:
        # Swapped files can turn gravity around, so they are looked for before gravity may speak of signs.
        swapped = None if signs.doubts or angles.sign.any() else judge_places(weights)
        if swapped is None:
            signs = judge_signs(robot, evidence, angles.sign, gravity_signs(weights))
        loads = judge_gravity(carrying, evidence, weights, signs.torque) if swapped is None else (swapped,)
    told = {doubt.message.partition(":")[0] for doubt in angles.doubts if doubt.cause == "angle_sign"}
    turned = [
        doubt for doubt in signs.doubts if doubt.cause != "angle_sign" or doubt.message.partition(":")[0] not in told
    ]
    doubts = (*late, *angles.doubts, *turned, *loads, *_noise_doubts(evidence), *saturation_doubts(evidence.saturated))
    rest = sorted(doubts, key=lambda doubt: (not doubt.decisive, -doubt.strength))
    return (*scales.doubts, *rest), angles.notes


def _without_delay(evidence: Evidence, declared_s: float) -> tuple[Evidence, list[Doubt]]:
    """Takes a delay that is not declared out of the responses, whose signs it would turn, and doubts it."""
    found = undeclared_delay(
        DrivingPoints(
            evidence.lines_hz,
            evidence.driving,
            evidence.signal_to_noise,
            evidence.sampling_period_s,
            evidence.hold_period_s,
        ),
        declared_s,
    )
    if found is None:
        return evidence, []
    samples, declared = found / evidence.sampling_period_s, declared_s / evidence.sampling_period_s
    told = (
        f"the phases of the motors' own responses leave no room for a delay below {two_digits(samples)} samples, "
        f"where {two_digits(declared)} are declared"
    )
    decisive = found * float(evidence.lines_hz.max()) > _HALF_TURN
    ahead = np.exp(2j * np.pi * evidence.frequency_hz * (found - declared_s))[:, None, None]
    return (
        replace(evidence, response=evidence.response * ahead),
        [Doubt("delay", told, decisive=decisive, strength=(samples - declared) / FEW_SAMPLES)],
    )


def _noise_doubts(evidence: Evidence) -> list[Doubt]:
    """Motors most of whose lines lie below 10 dB; decisive where they are hardly more than noise."""
    if evidence.signal_to_noise is None:
        return []
    doubts = []
    middle = np.median(evidence.signal_to_noise, axis=(0, 1))
    for name, ratio in zip(evidence.names, middle.tolist(), strict=True):
        if ratio < CLEAR:
            level = 10 * np.log10(max(ratio, 1e-3))
            told = f"{name}: half of its lines have a signal-to-noise ratio below {level:.2g} dB"
            doubts.append(Doubt("excitation", told, decisive=ratio < _LOST, strength=CLEAR / max(ratio, 1e-3)))
    return doubts
