"""The counterbalance of a joint in a robot file."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from robid.arrays import FloatArray
from robid.robot.description import HarmonicBalance, SpringBalance
from robid.settings.base import Assumed, Vector

SPRING_KEYS = ("carrier_point_m", "link_point_m", "free_length_m", "stiffness_n_m")
HARMONIC_KEYS = ("sine_nm", "cosine_nm")


class CounterbalanceSection(Assumed):
    """What takes gravity off a motor: harmonics of the joint's angle, or a spring or cylinder between two points."""

    sine_nm: tuple[float, ...] = Field(
        default=(), description="Torque on the arm per sine of the joint's angle, of twice the angle and so on [N m]."
    )
    cosine_nm: tuple[float, ...] = Field(default=(), description="The same per cosine [N m].")
    carrier_point_m: Vector | None = Field(
        default=None,
        description="End of the spring on what carries the joint, in the link's frame as it is at zero position [m].",
    )
    link_point_m: Vector | None = Field(
        default=None, description="End of the spring on the link, in the link's frame [m]."
    )
    free_length_m: float | None = Field(
        default=None, description="Length at which the spring pulls with `preload_n` [m].", ge=0
    )
    stiffness_n_m: float | None = Field(default=None, description="Stiffness of the spring [N/m].", ge=0)
    preload_n: float = Field(
        default=0.0, description="Pull of the spring at its free length; negative where it pushes [N]."
    )

    def counterbalance(self, position: FloatArray, rotation: FloatArray) -> HarmonicBalance | SpringBalance:
        """Returns the plain description.

        Args:
            position (3,): Origin of the link's frame in the joint frame [m].
            rotation (3, 3): Its orientation there.
        """
        ends, length, stiffness = (self.carrier_point_m, self.link_point_m), self.free_length_m, self.stiffness_n_m
        if ends[0] is None or ends[1] is None or length is None or stiffness is None:
            n_harmonic = max(len(self.sine_nm), len(self.cosine_nm))
            levels = [np.pad(level, (0, n_harmonic - len(level))) for level in (self.sine_nm, self.cosine_nm)]
            return HarmonicBalance(np.asarray(levels[0], float), np.asarray(levels[1], float))
        carrier, link = (position + rotation @ np.array(end) for end in ends)
        return SpringBalance(carrier, link, length, stiffness, self.preload_n)
