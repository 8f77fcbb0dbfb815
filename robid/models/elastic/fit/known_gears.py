"""Gears that another fit has found: what is known beforehand of a fit's springs, each a gear with what lies in line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from robid.results.gears import KnownGear
from robid.robot.description import Robot, Spring

MOST_SHARE = 0.9
"""Of a gear's compliance that may lie in line with it."""
HALF_MEAN = float(np.sqrt(2 / np.pi))
"""Mean of half a normal distribution, over its deviation."""
_HALF_STD = float(np.sqrt(1 - 2 / np.pi))


@dataclass(frozen=True)
class Chain:
    """A gear with what lies in line with it, over the gear alone, by a share of compliance with half a normal prior.

    With a share `s` of the chain's compliance that is not the gear's, the chain has the stiffness `k (1 - s)`.
    """

    share_std: float  # Deviation of the share: `chain_compliance` of the robot file

    @property
    def factor(self) -> float:
        """Stiffness of the chain over that of the gear, at the mean share."""
        return 1 - min(HALF_MEAN * self.share_std, MOST_SHARE)

    @property
    def std(self) -> float:
        """Standard deviation of the logarithm of that factor."""
        return _HALF_STD * self.share_std / self.factor


def chain_of(robot: Robot, spring: Spring) -> Chain:
    """Returns what the robot file says of what lies in line with a gear."""
    return Chain(robot.joints[spring.joint].nuisance_std.chain_compliance)


def with_known_gears(robot: Robot, gears: Mapping[str, KnownGear]) -> Robot:
    """Returns a robot whose springs are gears that another fit has found, with how well they are known.

    Two encoders see the gear alone, responses to torques the gear with what lies in line with it: that is softer by the
    share of compliance that the robot file allows for, whose deviation adds to that of the gear. Gears whose stiffness
    depends on a joint's position stay as in the robot file.

    Args:
        robot: The robot file's robot.
        gears: What is known of each gear alone, by the name of its spring; others stay as they are.
    """
    springs = tuple(
        _chained(spring, gears[spring.name], chain_of(robot, spring)) if is_known(spring, gears) else spring
        for spring in robot.springs
    )
    return replace(robot, springs=springs)


def is_known(spring: Spring, gears: Mapping[str, KnownGear]) -> bool:
    """Whether a spring is one of these gears."""
    return spring.place == "transmission" and spring.stiffness_over is None and spring.name in gears


def _chained(spring: Spring, gear: KnownGear, chain: Chain) -> Spring:
    found = replace(
        spring,
        stiffness=gear.stiffness * chain.factor,
        stiffness_std=float(np.hypot(gear.stiffness_std, chain.std)),
    )
    if gear.slip is not None:
        # Torques in series are the same: what lies in line changes nothing about where it slips.
        found = replace(found, slip=gear.slip, slip_std=gear.slip_std)
    if gear.cubic is None:
        return found
    # A cubic torque k3 x^3 acts on the gear's share of the deflection: in series it is k3 (1 - s)^4.
    cubic = gear.cubic * chain.factor**4
    std = np.hypot(gear.cubic_std * chain.factor**4, 4 * chain.std * cubic)
    return replace(found, cubic=cubic, cubic_std=float(std))
