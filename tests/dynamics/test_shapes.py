"""Whoever computes with a body from Python and hands over the wrong shape is told the right one, by every body."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pipelines.dynamics.base_parameters import BaseArm
from pipelines.dynamics.body import Array, RigidBody
from pipelines.dynamics.rrr import RRR
from pipelines.io.robot_files import load_robot

ROBOT = load_robot("rrr")
SIX = replace(ROBOT, name="six", joints=ROBOT.joints + ROBOT.joints)
BODIES = {"closed form": RRR(ROBOT), "recursion": BaseArm(ROBOT), "six joints": BaseArm(SIX)}
METHODS: dict[str, Callable[[RigidBody, Array, Array], object]] = {
    "regressor": lambda body, q, p: body.regressor(q, q, q),
    "torque": lambda body, q, p: body.torque(q, q, q, p),
    "torque_parts": lambda body, q, p: body.torque_parts(q, q, q, p),
    "mass_matrix": lambda body, q, p: body.mass_matrix(q, p),
    "tip": lambda body, q, p: body.tip(q),
}


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_wrong_shapes_are_told_the_right_one(body: RigidBody, method: Callable[..., object]) -> None:
    """One posture as a vector, transposed samples, too many joints: a ValueError, never a number, never a TypeError."""
    n, p = body.robot.n_joints, np.zeros(len(body.parameters))
    method(body, np.zeros((5, n)), p)
    for wrong in (np.zeros(n), np.zeros((n, 5)), np.zeros((5, n + 1)), np.zeros((2, 5, n)), np.zeros(())):
        with pytest.raises(ValueError, match=rf"q has the shape \(.*\), wanted is \(samples, {n}\)"):
            method(body, wrong, p)
