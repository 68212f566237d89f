"""An arm in complex arithmetic, for derivatives by the complex step: Newton and Euler in the base frame, parameter by parameter.

Written from the textbook, link by link, with nothing of the package but the placement of its frames.
"""

from __future__ import annotations

import numpy as np

from pipelines.dynamics.base_parameters import BaseArm
from pipelines.dynamics.body import RigidBody
from pipelines.dynamics.kinematics import SerialChain, serial_chain
from pipelines.dynamics.rrr import RRR

__all__ = ["complex_regressor", "complex_tip"]


def _links(chain: SerialChain, motion: np.ndarray) -> list[tuple[np.ndarray, ...]]:
    """Of every link (R, p, ω, α, a, axis, anchor) in base axes, samples first, for motion (3, joints, samples)."""
    n = motion.shape[2]
    r, p = np.tile(np.eye(3, dtype=complex), (n, 1, 1)), np.zeros((n, 3), dtype=complex)
    w, alpha = np.zeros((n, 3), dtype=complex), np.zeros((n, 3), dtype=complex)
    a, v = np.tile(-chain.gravity.astype(complex), (n, 1)), np.zeros((n, 3), dtype=complex)
    found = []
    for i in range(chain.n_joints):
        lever = r @ chain.before[i].position
        v, a, p, r = (v + np.cross(w, lever), a + np.cross(alpha, lever) + np.cross(w, np.cross(w, lever)), p + lever,
                      r @ chain.before[i].rotation)
        axis, speed, rise = r[:, :, 2], motion[1, i][:, None], motion[2, i][:, None]
        angle = motion[0, i] + chain.offset[i]
        if chain.revolute[i]:
            alpha, w = alpha + rise * axis + np.cross(w, speed * axis), w + speed * axis
            c, s, o = np.cos(angle), np.sin(angle), np.zeros_like(angle)
            turn = np.moveaxis(np.array([[c, -s, o], [s, c, o], [o, o, o + 1]]), 2, 0)
            anchor, r = p, r @ turn
        else:
            shift = angle[:, None] * axis
            a = a + np.cross(alpha, shift) + np.cross(w, np.cross(w, shift)) + 2 * np.cross(w, speed * axis) + rise * axis
            v = v + np.cross(w, shift) + speed * axis
            anchor, p = p, p + shift
        lever = r @ chain.after[i].position
        v, a, p, r = (v + np.cross(w, lever), a + np.cross(alpha, lever) + np.cross(w, np.cross(w, lever)), p + lever,
                      r @ chain.after[i].rotation)
        found.append((r, p, w, alpha, a, axis, anchor, v))
    return found


def _standard(chain: SerialChain, motion: np.ndarray) -> np.ndarray:
    """(samples, joints, 10 joints): torque of every standard parameter at unit value."""
    links, n, samples = _links(chain, motion), chain.n_joints, motion.shape[2]
    out = np.zeros((samples, n, 10 * n), dtype=complex)
    for i, (r, p, w, alpha, a, *_) in enumerate(links):
        for k in range(10):
            mass, h, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
            if k == 0:
                mass = 1.0
            elif k < 4:
                h[k - 1] = 1.0
            else:
                x, y, sign = ((0, 0, 1), (1, 1, 1), (2, 2, 1), (0, 1, -1), (0, 2, -1), (1, 2, -1))[k - 4]
                inertia[x, y] = inertia[y, x] = sign
            turned = r @ inertia @ np.swapaxes(r, 1, 2)
            arm = r @ h
            force = mass * a + np.cross(alpha, arm) + np.cross(w, np.cross(w, arm))
            moment = (turned @ alpha[..., None])[..., 0] + np.cross(w, (turned @ w[..., None])[..., 0]) + np.cross(arm, a)
            moment = moment + np.cross(p, force)
            for j in range(i + 1):
                axis, anchor = links[j][5], links[j][6]
                load = moment - np.cross(anchor, force) if chain.revolute[j] else force
                out[:, j, 10 * i + k] = (axis * load).sum(axis=1)
    return out


def complex_regressor(body: RigidBody, motion: np.ndarray) -> np.ndarray:
    """(samples, joints, parameters) of `body` for complex motion (3, joints, samples)."""
    chain = serial_chain(body.robot)
    standard = _standard(chain, motion)
    if isinstance(body, BaseArm):
        return standard[:, :, list(body.base.chosen)]
    assert isinstance(body, RRR)
    return standard @ np.linalg.pinv(_moments(body))


def _moments(body: RRR) -> np.ndarray:
    """K (15, 30) with p = K φ, from (A4) written with unit links: then R = Y K⁺, for K has full row rank."""
    from dataclasses import replace

    from pipelines.io.robot import LinkParameters

    columns = []
    for index in range(30):
        links = []
        for i in range(3):
            values = np.zeros(10)
            if i == index // 10:
                values[index % 10] = 1.0
            # first moments are mass times centre: a unit mass with its moment, less the mass alone
            moment = 1 <= index % 10 <= 3 and i == index // 10
            mass = 1.0 if moment or values[0] else 0.0
            links.append(LinkParameters(mass, tuple(values[1:4]), tuple(values[4:])))
        joints = tuple(replace(joint, link=link) for joint, link in zip(body.robot.joints, links, strict=True))
        column = RRR(replace(body.robot, joints=joints)).known_parameters()
        assert column is not None
        if 1 <= index % 10 <= 3:
            column = column - columns[10 * (index // 10)]
        columns.append(column)
    return np.array(columns).T


def complex_tip(body: RigidBody, motion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tip position and velocity (samples, 3)."""
    chain = serial_chain(body.robot)
    r, p, w, _, _, _, _, v = _links(chain, motion)[-1]
    lever = r @ chain.tip
    return p + lever, v + np.cross(w, lever)
