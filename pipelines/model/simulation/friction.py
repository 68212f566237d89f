"""Friction of all joints and replicas in a few array operations: every law that is a `SpeedCurve`, stacked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.model.effects.base import SpeedCurve
from pipelines.model.rigid.body import Array

__all__ = ["ManyCurves", "stacked"]


@dataclass(frozen=True)
class ManyCurves:
    """τ = constant + viscous v + Σ height tanh(sharpness v), joint by joint."""

    constant: Array  # [N m] (joints,)
    viscous: Array  # [N m s/rad] (joints,)
    heights: Array  # [N m] (sigmoids, joints); joints with fewer sigmoids have zeros
    sharpnesses: Array  # [s/rad] (sigmoids, joints)

    def prepared(self, replicas: int) -> PreparedCurves:
        return PreparedCurves(self, replicas)


class PreparedCurves:
    """The curves with working memory for a number of replicas."""

    def __init__(self, curves: ManyCurves, replicas: int) -> None:
        self._constant, self._viscous = curves.constant[:, None], curves.viscous[:, None]
        self._heights, self._sharpnesses = curves.heights[..., None], curves.sharpnesses[..., None]
        self._shifted = bool(curves.constant.any())
        self._bent = curves.heights.size > 0
        self._work = np.empty((*curves.heights.shape, replicas))
        self._sum = np.empty((len(curves.constant), replicas))

    def take_off(self, torque: Array, dq: Array, out: Array) -> None:
        """`torque` less friction into `out`, all (joints, replicas)."""
        np.multiply(self._viscous, dq, out=self._sum)
        np.subtract(torque, self._sum, out=out)
        if self._bent:
            np.multiply(self._sharpnesses, dq, out=self._work)
            np.tanh(self._work, out=self._work)
            np.multiply(self._work, self._heights, out=self._work)
            np.add.reduce(self._work, axis=0, out=self._sum)
            np.subtract(out, self._sum, out=out)
        if self._shifted:
            np.subtract(out, self._constant, out=out)


def stacked(curves: Sequence[tuple[int, SpeedCurve]], n_joints: int) -> ManyCurves:
    """The curves, each with its joint (0-based), as arrays."""
    constant, viscous = np.zeros(n_joints), np.zeros(n_joints)
    terms: list[list[tuple[float, float]]] = [[] for _ in range(n_joints)]
    for joint, curve in curves:
        constant[joint] += curve.constant
        viscous[joint] += curve.viscous
        terms[joint] += zip(curve.heights, curve.sharpnesses, strict=True)
    most = max(map(len, terms))
    filled = np.array([own + [(0.0, 1.0)] * (most - len(own)) for own in terms]).reshape(n_joints, most, 2)
    return ManyCurves(constant, viscous, filled[..., 0].T.copy(), filled[..., 1].T.copy())
