"""What held joints that give way do to the joint that is driven, to first order in their sway δ.

A controller lets a held joint k lean by milliradians when joint j beside it is driven. Row j of the arm's equations then has,
with q that of joint j and every number free,

    (d0 + d1 sin q + d2 cos q) ddδ        D_jk, where k is nearer the base than j; beyond j it does not depend on q: d0 ddδ
    (g1 sin q + g2 cos q) δ               weight that leans with k
    m d/dt (δ dq)                         D_jj depends on the joints beyond j, not on those before it

Small as they are, they come with every torque of the driven joint: left out, they pass for inertia. Sin and cos stand for the
rotation of a revolute joint; a prismatic one has q itself in D_jk, and a weight that does not depend on q.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.model.rigid.body import Array

__all__ = ["Sway", "sway_columns"]


@dataclass(frozen=True, eq=False)
class Sway:
    """A joint that is held and gives way, beside the one that is driven."""

    lean: Array  # δ [rad] (samples,) from where it is held
    speed: Array  # [rad/s] (samples,)
    nearer: bool  # the base than the driven joint


def sway_columns(t: Array, q: Array, dq: Array, sways: Sequence[Sway], revolute: bool) -> Array:
    """Their columns as means over the step after each sample (samples, columns); the last row is zero.

    Args:
        t, q, dq: (samples,) time, position and speed of the driven joint.
    """
    if not sways:
        return np.zeros((len(t), 0))
    rate = 1.0 / np.diff(t)
    middle = 0.5 * (q[1:] + q[:-1])
    turn = [np.sin(middle), np.cos(middle)]
    found: list[Array] = []
    for sway in sways:
        push, lean = np.diff(sway.speed) * rate, 0.5 * (sway.lean[1:] + sway.lean[:-1])
        found.append(push)
        if sway.nearer:
            found += [push * part for part in (turn if revolute else [middle])]
        else:
            found.append(np.diff(sway.lean * dq) * rate)
        found += [lean * part for part in turn] if revolute else [lean]
    return np.vstack([np.stack(found, axis=1), np.zeros((1, len(found)))])
