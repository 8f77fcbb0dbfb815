"""Something seen in data or a result that speaks against its use, with its likely cause."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.later import imported, later
from robid.results.scale import Scale

with later(__name__):
    from robid.frf.channels import SATURATED_SHARE, saturation_error

CAUSES = {
    "torque_sign": "a torque with the wrong sign (F001)",
    "angle_sign": "an angle with the wrong sign (F002)",
    "torque_constant": "a torque constant that is off (F003)",
    "gear_ratio": "a gear ratio that is off (F004)",
    "zero": "a zero of the angles that is off (F005)",
    "configurations": "configurations that are swapped or mislabelled (F006)",
    "delay": "a delay that is not declared (F007)",
    "samples": "speeds whose samples are not what was stated (F008)",
    "filters": "filters that let the noise of the positions pass (F009)",
    "channels": "channels of another motor, or whose sign or unit differs between records (F063)",
    "units": "units or gear ratios of the log that are off (F010)",
    "same_motion": "a motion that the fit has seen already (F011)",
    "same_configuration": "configurations that the fit has seen already (F012)",
    "excitation": "too little signal for the sensors' noise (F013)",
    "payload": "a payload that is off (F014)",
    "masses": "masses or centres of mass that are off (F015)",
    "counterbalance": "a counterbalance that the robot file lacks (F016)",
    "counterbalance_law": "a counterbalance that pulls by another law than stated (F041)",
    "torque_sensor": "torques of sensors behind the gears, of joints that need `torque_measured_at: joint` (F017)",
    "rotor_inertia": "rotor inertias that are off (F018)",
    "held_spring": "springs or dampers that are off and not estimated (F019)",
    "missing_spring": "a spring that the robot file lacks (F020)",
    "friction": "friction of another kind or size (F021)",
    "arm_friction": "viscous friction behind a transmission, which `arm_viscous` in `free` estimates (F022)",
    "gear_nonlinearity": "gears with hysteresis, backlash or stiffening that the model lacks (F023)",
    "gear_coupling": "a gear that turns with other joints in another way than stated (F024)",
    "coupling": "commands of other channels, which move this one too (F025)",
    "saturation": "a limit of range, torque, speed or acceleration that was reached (F026)",
    "unsteady": "a drift, or repeats from before the robot had settled (F027)",
    "band": "motions that are faster or larger than those of the fit (F028)",
    "model": "something that the model lacks (F029)",
    "hidden": "something that these data would not have shown (F062)",
}
"""Likely causes, in words, each with its code."""


def two_digits(value: float, sign: str = "") -> str:
    """Writes a number with two digits, never with an exponent; `+` as sign shows it always."""
    return f"{float(f'{value:.2g}'):{sign}.15g}"


@dataclass(frozen=True)
class Finding:
    """Something seen in data or a result that speaks against its use."""

    cause: str  # The likely cause, of `CAUSES`
    message: str  # What was seen and where, a clause without a full stop
    decisive: bool  # Whether nothing that follows from the data may be used while it stands
    strength: float  # How far beyond what is normal, a ratio above 1; the strongest of a kind comes first
    # Which wrong scales explain it, the likeliest first, those that give the same data beside each other
    scales: tuple[Scale, ...] = ()

    @property
    def sentence(self) -> str:
        """What was seen, and what it points to."""
        return f"{self.message}: this points to {CAUSES[self.cause]}"


def blamed(error: DataError, findings: Sequence[Finding]) -> DataError:
    """Returns a refusal that names the wrong scale first whose doing it is, where one was seen."""
    seen = next((finding for finding in findings if finding.scales), None)
    if seen is None:
        return error
    return DataError(f"{seen.sentence}; with it, {error.what}", where=error.where, remedy="correct the log's mapping")


_CLIPPED = 0.05
"""Share of the time from which a response that may be off by as much must not be used."""


def saturation_findings(signals: Mapping[str, FloatArray]) -> tuple[Finding, ...]:
    """Findings about signals that saturate: where the log has clipped them, that counts.

    Args:
        signals: Share of the time (n_conf,) in which each saturates, 0 where it does not, by what it is.
    """
    findings = []
    for name, share in signals.items():
        worst = float(share.max(initial=0.0))
        if worst > 0:
            off = f"{two_digits(100 * saturation_error(worst))} %"
            share_told = f"{name} saturates for {two_digits(100 * worst)} % of the time"
            told = f"{share_told}, which may put its responses off by {off} and more"
            findings.append(
                Finding("saturation", told, decisive=worst > _CLIPPED, strength=1 + worst / imported(SATURATED_SHARE))
            )
    return tuple(findings)
