"""What encoders on the arm side show: a loose coupling, a lag, a disc that is not centred."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mujoco.batch import Batch

from robid.arrays import FloatArray
from robid.robot.model import ElasticModel
from robid.simulate.late import Late
from robid.simulate.options import Imperfections


class LinkEncoders:
    """Reads the arm-side encoders of some joints, noise and rounding not included.

    Args:
        model: The elastic model.
        batch: The simulations.
        joints (n_arm,): Indices of the joints.
        flaws: What is not exact; play and eccentricity are those of revolute joints.
        period_s: Sampling period [s].
    """

    def __init__(
        self, model: ElasticModel, batch: Batch, joints: Sequence[int], flaws: Imperfections, period_s: float
    ) -> None:
        self._qpos, self._qvel, self._arms = batch.qpos, batch.qvel, model.arm[list(joints)]
        turning = ~model.robot.prismatic[list(joints)]
        self._half_play = 0.5 * flaws.link_encoder_play_rad * turning
        self._eccentricity, self._phase = (
            flaws.link_encoder_eccentricity_rad * turning,
            flaws.link_encoder_eccentricity_phase_rad,
        )
        self._late = Late(np.full(len(joints), flaws.link_encoder_lag_s), period_s)
        self._plays, self._wobbles = bool(self._half_play.any()), bool(self._eccentricity.any())
        self.begin()

    def begin(self) -> None:
        """Begins where the batch is: shafts in the middle of their play, arms as if they had kept their speeds."""
        self._shaft, self._taken = self.true(), np.array(True)
        if self._late.lags:
            self._late.begin(self._shaft, self._qvel[:, self._arms])

    def true(self) -> FloatArray:
        """Returns the arms' positions (n_sim, n_arm) now [rad, or m]."""
        return np.array(self._qpos[:, self._arms])

    def read(self) -> FloatArray:
        """Returns what the encoders show (n_sim, n_arm) at the beginning of a sample, once a sample [rad, or m]."""
        shown = self._shafts() if self._plays else self.true()
        if self._late.lags:
            shown = self._late.read(shown, self._qvel[:, self._arms] * self._taken)
        if self._wobbles:
            shown = shown + self._eccentricity * np.sin(shown + self._phase)
        return shown

    def _shafts(self) -> FloatArray:
        """The encoders' shafts (n_sim, n_arm), by the play operator: each stays until the arm takes it along."""
        arm, before = self.true(), self._shaft
        self._shaft = np.clip(before, arm - self._half_play, arm + self._half_play)
        self._taken = self._shaft != before
        return self._shaft
