"""A drive that cannot give all the torque of its command."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.functions import Functions
from pipelines.effects.base import (
    ArmModel,
    Effect,
    Hooks,
    Parameters,
    Predict,
    Quantity,
    Values,
    predicted,
)

__all__ = ["TorqueSaturation"]


@dataclass(frozen=True)
class TorqueSaturation(Effect):
    """Applied torque = u - e, e = sign(u) max(|u| - L, 0), u the logged torque.

    The log shows e more than the arm feels.

    The arm's motion tells the torque that came out, never what was asked for above L: u is
    `Motion.tau`, or where there is none the predicted torque. Held over each sample, e_k is the
    average of e over it; the column is e itself at t_k: (7 (e_k + e_{k-1}) - e_{k+1} - e_{k-2})/12,
    Colella & Woodward 1984, eq. (1.9) with even steps.
    """

    limit: float = 10.0  # L [N m]

    name = "torque_saturation"
    parameters = Parameters(
        Quantity("limit", "N m", 1e-3, 1e5, "largest torque that comes out", shape=True,
                 reads_torque=True),
        Quantity("coefficient", "1", 0.0, 2.0,
                 "share of the excess that is lost: 1 where the drive clips", fixed=1.0,
                 healthy=0.0))
    acts_on = "drive"

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return self.on_own_row(arm,
                               self._excess(motion, self.own(self._asked(motion, arm)), self.limit))

    def shapes(self, motion: Motion, arm: ArmModel) -> Iterator[Self]:
        """Parts of the largest torque that is asked for."""
        peak = max(float(np.abs(self.own(self._asked(motion, arm))).max()), 1e-3)
        for share in (0.45, 0.55, 0.65, 0.75, 0.82, 0.88, 0.94):
            yield replace(self, limit=float(np.clip(share * peak, 1e-3, 1e5)))

    def apply(self, motion: Motion, arm: ArmModel, values: Values,
              predict: Predict | None = None) -> Array:
        tau = predict(motion, arm) if predict is not None else arm.torque(motion)
        asked = self.own(tau if motion.tau is None else motion.tau)
        tau[:, self._index] += values["coefficient"] * self._excess(motion, asked, values["limit"])
        return tau

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        index, limit, share = self._index, values["limit"], values["coefficient"]

        def applied(command: Sequence[Any], _: Sequence[Any], m: Functions) -> Any:
            asked = command[index]
            return asked - share * (asked - m.smaller(m.larger(asked, -limit), limit))

        return Hooks(drive=(index, applied))

    def _asked(self, motion: Motion, arm: ArmModel) -> Array:
        return predicted(arm, motion) if motion.tau is None else motion.tau

    def _excess(self, motion: Motion, asked: Array, limit: float) -> Array:
        excess = _above(asked, limit)
        if motion.tau is None or len(excess) < 4:  # noqa: PLR2004
            return excess
        between = 0.5 * (excess[1:] + excess[:-1])
        between[1:-1] = (7.0 * (excess[2:-1] + excess[1:-2]) - excess[3:] - excess[:-3]) / 12.0
        return np.concatenate([excess[:1], between])


def _above(torque: Array, limit: float) -> Array:
    return np.asarray(torque - np.clip(torque, -limit, limit))
