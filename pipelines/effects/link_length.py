"""A link that is not as long as described."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.altered import carry_over, masses_beyond, with_longer_link
from pipelines.dynamics.body import Array, Motion
from pipelines.effects.base import ArmModel, Effect, Hooks, Parameters, Predict, Quantity, Values

__all__ = ["LinkLength"]

_STEP = 1e-3  # numerics: [m] of the difference: torque is close to quadratic in a length


@dataclass(frozen=True)
class LinkLength(Effect):
    """τ = Y(a + e) p'.

    All beyond link k sits e further along it, along x of its frame, in a URDF towards the next
    joint.

    p' are the base parameters of the same links in the new geometry.
    """

    link: float = 1.0  # k, 1-based: from joint k to joint k + 1

    name = "link_length"
    scope = "arm"
    parameters = Parameters(
        Quantity("error", "m", -1.0, 1.0, "true length minus that of the description"),
        Quantity("link", "1", 1.0, 100.0, "which link, counted from the base", shape=True,
                 discrete=True, link=True))

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        either = [self._altered(arm, by) for by in (_STEP, -_STEP)]
        longer, shorter = (one.body.torque(motion.q, motion.dq, motion.ddq, one.p)
                           for one in either)
        return np.asarray(longer - shorter)[..., None] / (2.0 * _STEP)

    def nuisance(self, arm: ArmModel) -> Array:
        """Masses beyond the link turn on a longer lever.

        How heavy each of them is base parameters do not say.
        """
        return masses_beyond(arm.body, int(self.link))

    def apply(self, motion: Motion, arm: ArmModel, values: Values,
              predict: Predict | None = None) -> Array:
        true = self.at(values)._altered(arm, values["error"])
        return predict(motion, true) if predict is not None else true.torque(motion)

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        return Hooks(arm=self.at(values)._altered(arm, values["error"]))

    def _altered(self, arm: ArmModel, by: float) -> ArmModel:
        if not by:
            return arm
        body = with_longer_link(arm.body, int(self.link), by)
        return arm.with_body(body, carry_over(arm.body, body) @ arm.p)
