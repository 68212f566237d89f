"""Judge the torque boundary on random machines: which of its fields are right, and how often it is
wrong about a whole torque.

    python -m benchmarks.torque_boundary --count 200 --first 5000 --out boundary.jsonl

Machines have 2 to 7 joints of several families, links, drives, friction laws and motions at
random; their torques are Pinocchio's. Each is logged whole, without gravity, without friction, as
magnitudes, on a wall, under a ceiling, with y up, and with permuted joints; and healthy
and faulty machines on which nothing may be claimed. A file of results is continued.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.hidden_effects.table import wilson
from pipelines.estimation.checks.boundary import Boundary, torque_boundary
from pipelines.estimation.checks.rows import sample_motion
from pipelines.estimation.config import BoundaryConfig
from pipelines.io.log import ExperimentLog, Signal
from pipelines.io.robot import Joint, LinkParameters, RobotDescription, format_robot
from pipelines.quality.subject import Subject

Array = npt.NDArray[np.float64]
ODDS = 2.0 * BoundaryConfig().decisive  # power over noise, below which the odds do not decide
DOWN = np.array([0.0, 0.0, -9.81])
KINDS = ("whole", "no gravity", "no friction", "magnitude", "wall", "ceiling", "y-up", "permuted")
FAULTS = (
    "healthy",
    "spring",
    "cogging",
    "payload",
    "tilt",
    "offset",
    "gain",
    "lag",
    "encoder",
    "longer link",
    "counterbalance",
    "flip",
    "scale",
    "delay",
)
CLAIM = {
    "no gravity": "gravity",
    "no friction": "friction",
    "magnitude": "sign",
    "wall": "turned",
    "ceiling": "turned",
    "y-up": "turned",
    "permuted": "order",
}  # what is right to claim of each kind


@dataclass(frozen=True, eq=False)
class Machine:
    """An arm, its motion and its nuisances."""

    family: str
    robot: RobotDescription  # as it is
    told: RobotDescription  # as its logs describe it
    friction: dict[str, Array]
    law: str
    rotor: Array  # [kg m^2] (n,)
    t: Array
    q: Array
    dq: Array
    ddq: Array
    noise: Array  # [N m] (n,)
    step: float  # [rad] of the encoders
    measured: bool
    seed: int


def _dh(
    family: str, rng: np.random.Generator
) -> tuple[list[tuple[float, float, float, str]], list[float]]:
    """Draw (a, alpha, d, type) of each joint, and the mean posture."""
    h, u = np.pi / 2, rng.uniform
    if family == "rrr":
        rows = [(0, h, u(0.3, 0.6)), (u(0.15, 0.5), 0, u(0, 0.2)), (u(0.15, 0.5), 0, u(0, 0.1))]
        return _turning(rows), [0, -0.8, 0.6]
    if family == "scara":
        first, second = (u(0.2, 0.4), 0, u(0.2, 0.4)), (u(0.2, 0.4), np.pi, 0)
        slide = (0, 0, 0, "prismatic")
        last = (0, 0, u(0.05, 0.1))
        return [*_turning([first, second]), slide, *_turning([last])], [0, 0.5, 0.15, 0]
    if family == "ur":
        s = u(0.6, 1.5)
        rows = [(0, h, 0.09 * s), (-0.425 * s, 0, 0), (-0.392 * s, 0, 0)]
        rows += [(0, h, 0.11 * s), (0, -h, 0.095 * s), (0, 0, 0.08 * s)]
        return _turning(rows), [0, -1.2, 1.2, -1.5, -1.5, 0]
    if family == "six":
        s = u(0.6, 2.0)
        rows = [(0.1 * s, -h, 0.4 * s), (0.4 * s, 0, 0), (0.03 * s, -h, 0)]
        rows += [(0, h, 0.4 * s), (0, -h, 0), (0, 0, 0.08 * s)]
        return _turning(rows), [0, -1.2, 0.3, 0, 0.6, 0]
    if family == "seven":
        s = u(0.7, 1.2)
        rows = [(0, -h, 0.34 * s), (0, h, 0), (0, h, 0.4 * s), (0, -h, 0)]
        rows += [(0, -h, 0.4 * s), (0, h, 0), (0, 0, 0.12 * s)]
        return _turning(rows), [0, 0.6, 0, -1.2, 0, 0.8, 0]
    return _any_arm(rng)


def _turning(rows: Sequence[tuple[float, float, float]]) -> list[tuple[float, float, float, str]]:
    return [(a, alpha, d, "revolute") for a, alpha, d in rows]


def _any_arm(rng: np.random.Generator) -> tuple[list[tuple[float, float, float, str]], list[float]]:
    """Draw two to seven joints of any kind, and the mean posture."""
    h, u = np.pi / 2, rng.uniform
    n = int(rng.integers(2, 8))
    rows = []
    for k in range(n):
        kind = "prismatic" if rng.random() < 0.12 and k else "revolute"
        rows.append(
            (
                float(u(0.05, 0.4) * (rng.random() < 0.7)),
                float(rng.choice([0, h, -h, h, -h, u(-1, 1)])),
                float(u(0.05, 0.4) * (rng.random() < 0.7)),
                kind,
            )
        )
    return rows, [float(u(-1, 1)) if row[3] == "revolute" else 0.2 for row in rows]


def draw(seed: int) -> Machine:
    """Return the machine of `seed`."""
    rng = np.random.default_rng([50, 2, seed])
    family = str(rng.choice(["rrr", "scara", "ur", "six", "seven", "random", "random"]))
    rows, home = _dh(family, rng)
    n = len(rows)
    mass = (
        float(np.exp(rng.uniform(np.log(2), np.log(60)))) * np.sort(rng.uniform(0.15, 1, n))[::-1]
    )
    links = tuple(_link(a, d, m, rng) for (a, _, d, _), m in zip(rows, mass, strict=True))
    joints = tuple(
        Joint(f"joint_{k + 1}", kind, float(a), float(alpha), float(d), link=link)
        for k, ((a, alpha, d, kind), link) in enumerate(zip(rows, links, strict=True))
    )
    robot = RobotDescription(f"{family}-{seed}", (0.0, 0.0, -9.81), "dh", joints)
    t, q, dq, ddq = random_motion(rng, n, np.array(home), np.array([j.revolute for j in joints]))
    described = rng.choice(["none", "right", "wrong"])
    told = replace(
        robot,
        joints=tuple(replace(j, link=_as_described(j.link, str(described), rng)) for j in joints),
    )
    load = inverse_dynamics(robot, q, dq, ddq, DOWN)
    direct = rng.random() < 0.25
    size = np.sqrt(np.mean(load**2, axis=0)) + 0.02 * np.sqrt(np.mean(load**2))
    speed = np.sqrt(np.mean(dq**2, axis=0))
    level = rng.uniform(0.02, 0.06, n) if direct else rng.uniform(0.08, 0.4, n)
    share = rng.uniform(0.3, 0.8, n)
    friction = {
        "coulomb": level * share * size,
        "viscous": level * (1 - share) * size / speed,
        "width": rng.uniform(0.005, 0.03, n) * speed,
        "slow": rng.uniform(0.05, 0.2, n) * speed,
    }
    law = str(rng.choice(["tanh", "tanh", "stribeck", "concave", "load", "asymmetric"]))
    inertia = np.array(
        [
            inverse_dynamics(robot, q[:1], 0 * q[:1], np.eye(n)[k : k + 1], 0 * DOWN)[0, k]
            for k in range(n)
        ]
    )
    rotor = inertia * (rng.uniform(0, 0.05, n) if direct else rng.uniform(0.1, 1.5, n))
    return Machine(
        family,
        robot,
        told,
        friction,
        law,
        rotor,
        t,
        q,
        dq,
        ddq,
        rng.uniform(0.002, 0.02) * size,
        float(rng.choice([1e-5, 2e-5, 1e-4])),
        bool(rng.random() < 0.5),
        seed,
    )


def _link(a: float, d: float, mass: float, rng: np.random.Generator) -> LinkParameters:
    """Draw a body around the straight line between the link's joints, with its own eccentricity."""
    length = float(np.hypot(a, d)) + 0.08
    com = np.array([-a * rng.uniform(0.2, 0.8), 0, 0]) + rng.normal(size=3) * 0.12 * length
    radii = length * rng.uniform(0.15, 0.45, 3)
    own = (
        mass
        / 5
        * np.diag(
            [
                radii[1] ** 2 + radii[2] ** 2,
                radii[0] ** 2 + radii[2] ** 2,
                radii[0] ** 2 + radii[1] ** 2,
            ]
        )
    )
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    about = turn @ own @ turn.T + mass * (com @ com * np.eye(3) - np.outer(com, com))
    xx, yy, zz, xy, xz, yz = (
        float(about[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    )
    x, y, z = map(float, com)
    return LinkParameters(float(mass), (x, y, z), (xx, yy, zz, -xy, -xz, -yz))


def _as_described(
    link: LinkParameters | None, how: str, rng: np.random.Generator
) -> LinkParameters | None:
    if link is None or how == "none":
        return None
    if how == "right":
        return link
    factor = float(rng.uniform(0.7, 1.3))
    com = tuple(float(c * rng.uniform(0.7, 1.3)) for c in link.com)
    return LinkParameters(
        link.mass * factor, com, tuple(float(v * factor * 1.1) for v in link.inertia)
    )  # type: ignore[arg-type]


def random_motion(
    rng: np.random.Generator, n: int, home: Array, revolute: Array
) -> tuple[Array, Array, Array, Array]:
    rate, length = float(rng.choice([100, 125, 250, 500, 1000])), float(rng.uniform(10, 25))
    t = np.arange(0, length, 1 / rate)
    reach = np.where(revolute, rng.uniform(0.4, 1.4, n), rng.uniform(0.08, 0.2, n))
    if rng.random() < 0.7:
        base = 2 * np.pi / float(rng.choice([5, 8, 10, 20]))
        order = np.arange(1, 6)
        c = rng.normal(size=(n, 5, 2)) / order[:, None]
        arg = base * np.outer(t, order)
        sine, cosine, rate = np.sin(arg).T, np.cos(arg).T, order * base
        q = (c[..., 0] @ sine + c[..., 1] @ cosine).T
        dq = ((c[..., 0] * rate) @ cosine - (c[..., 1] * rate) @ sine).T
        ddq = -((c[..., 0] * rate**2) @ sine + (c[..., 1] * rate**2) @ cosine).T
        scale = reach / np.abs(q).max(axis=0)
        return t, home + q * scale, dq * scale, ddq * scale
    moves = int(rng.integers(8, 16))
    poses = home + rng.uniform(-1, 1, (moves + 1, n)) * reach
    each = length / moves
    k = np.minimum((t / each).astype(int), moves - 1)
    rest = rng.uniform(0, 0.2)
    s = np.clip((t - k * each) / (each * (1 - rest)), 0, 1)
    shape = 10 * s**3 - 15 * s**4 + 6 * s**5
    first = (30 * s**2 - 60 * s**3 + 30 * s**4) / (each * (1 - rest))
    second = (60 * s - 180 * s**2 + 120 * s**3) / (each * (1 - rest)) ** 2
    step = poses[k + 1] - poses[k]
    return t, poses[k] + step * shape[:, None], step * first[:, None], step * second[:, None]


def _pinocchio(robot: RobotDescription) -> Any:
    import pinocchio as pin

    model = pin.Model()
    parent, place = 0, pin.SE3.Identity()
    for k, joint in enumerate(robot.joints):
        kind = pin.JointModelRZ() if joint.revolute else pin.JointModelPZ()
        parent = model.addJoint(parent, kind, place, f"j{k}")
        c, s = np.cos(joint.alpha), np.sin(joint.alpha)
        place = pin.SE3(
            np.array([[1, 0, 0], [0, c, -s], [0, s, c]]), np.array([joint.a, 0, joint.d])
        )
        link = joint.link
        assert link is not None
        com = np.array(link.com)
        xx, yy, zz, xy, xz, yz = link.inertia
        origin = np.array([[xx, -xy, -xz], [-xy, yy, -yz], [-xz, -yz, zz]])
        own = origin - link.mass * (com @ com * np.eye(3) - np.outer(com, com))
        model.appendBodyToJoint(parent, pin.Inertia(link.mass, com, own), place)
    return model


def inverse_dynamics(
    robot: RobotDescription, q: Array, dq: Array, ddq: Array, gravity: Array
) -> Array:
    """Return the torque (samples, n) [N m] by Pinocchio."""
    import pinocchio as pin

    model = _pinocchio(robot)
    model.gravity.linear = np.array(gravity)
    data = model.createData()
    return np.array([pin.rnea(model, data, a, b, c) for a, b, c in zip(q, dq, ddq, strict=True)])


def friction_torque(machine: Machine, load: Array) -> Array:
    f, v = machine.friction, machine.dq
    sign = np.tanh(v / f["width"])
    coulomb = f["coulomb"] * np.ones_like(v)
    if machine.law == "stribeck":
        coulomb = coulomb * (1 + 0.4 * np.exp(-((v / f["slow"]) ** 2)))
    if machine.law == "load":
        coulomb = 0.6 * coulomb + 0.05 * np.abs(load)
    if machine.law == "asymmetric":
        coulomb = coulomb * np.where(v > 0, 1.15, 0.85)
    if machine.law == "concave":
        return coulomb * sign + f["viscous"] * np.sqrt(np.abs(v) * np.abs(v).max(axis=0)) * np.sign(
            v
        )
    return coulomb * sign + f["viscous"] * v


def case(seed: int, kind: str, fault: str = "healthy") -> tuple[ExperimentLog, dict[str, Any]]:
    """Return the log of a machine, and what is true of it."""
    machine = draw(seed)
    rng = np.random.default_rng([50, 3, seed, KINDS.index(kind), FAULTS.index(fault)])
    turned = _turned(kind, rng)
    arm, q = machine.robot, machine.q
    if fault == "longer link":
        k = int(np.argmax([abs(j.a) for j in arm.joints]))
        arm = replace(
            arm,
            joints=tuple(
                replace(j, a=j.a * 1.05) if i == k else j for i, j in enumerate(arm.joints)
            ),
        )
    gravity = 0 * DOWN if kind == "no gravity" else turned
    if fault == "tilt":
        gravity = 9.81 * np.array([np.sin(0.087), 0, -np.cos(0.087)])
    load = inverse_dynamics(arm, q, machine.dq, machine.ddq, gravity)
    tau = load + machine.rotor * machine.ddq * (kind != "no friction" or rng.random() < 0.5)
    friction = friction_torque(machine, load) * (kind != "no friction")
    rigid, tau = tau, tau + friction
    tau, q = _faulty(tau, q, machine, fault, rng)
    tau = tau + machine.noise * rng.normal(size=tau.shape)
    q = machine.step * np.round((q + 0.5 * machine.step * rng.normal(size=q.shape)) / machine.step)
    if kind == "magnitude":
        tau = np.abs(tau)
    n = q.shape[1]
    order = np.arange(n)
    if kind == "permuted":
        while (order == np.arange(n)).all():
            order = rng.permutation(n) if rng.random() < 0.5 else _swapped(n, rng)
    log = logged(machine, q[:, order], tau[:, order])
    truth = {
        "gravity": kind != "no gravity",
        "friction": kind != "no friction",
        "sign": kind != "magnitude",
        "direction": turned.tolist(),
        "order": np.argsort(order).tolist(),
        "dissipated": _dissipated(machine, log, rigid, friction),
        "family": machine.family,
        "n": n,
    }
    return log, truth


def _swapped(n: int, rng: np.random.Generator) -> npt.NDArray[np.intp]:
    order = np.arange(n)
    a, b = rng.choice(n, 2, replace=False)
    order[[a, b]] = order[[b, a]]
    return order


def _turned(kind: str, rng: np.random.Generator) -> Array:
    angle = rng.uniform(0, 2 * np.pi)
    if kind == "wall":
        return 9.81 * np.array([np.cos(angle), np.sin(angle), 0])
    if kind == "ceiling":
        return -DOWN
    return 9.81 * np.array([0.0, -1.0, 0.0]) if kind == "y-up" else DOWN


def _faulty(
    tau: Array, q: Array, machine: Machine, fault: str, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Return torque and position with a fault of the bench in them."""
    n = tau.shape[1]
    j = int(rng.integers(n))
    size = np.std(tau, axis=0)
    own = np.eye(n)[j]
    span = np.ptp(q, axis=0)
    if fault == "spring":
        tau = tau + own * (0.3 * size / span * (q - q.mean(axis=0)))
    elif fault == "cogging":
        tau = tau + own * 0.08 * size * np.sin(
            rng.uniform(6, 30) * q * (1 if machine.robot.joints[j].revolute else 20)
        )
    elif fault == "offset":
        tau = tau + own * 0.3 * size
    elif fault == "gain":
        tau = tau * (1 + 0.1 * own)
    elif fault == "lag":
        late = np.interp(machine.t - 0.006, machine.t, tau[:, j])
        tau = np.where(own > 0, late[:, None], tau)
    elif fault == "encoder":
        q = q + own * 0.004 * np.sin(q)
    elif fault == "flip":
        tau = tau * (1 - 2 * own)
    elif fault == "scale":
        q = q * (1 + own)
    elif fault == "delay":
        tau = np.stack(
            [np.interp(machine.t - 0.01, machine.t, column) for column in tau.T], axis=-1
        )
    elif fault == "counterbalance":
        k = min(1, n - 1)
        tau = tau + np.eye(n)[k] * 0.5 * size[k] * np.sin(q[:, k : k + 1] + rng.uniform(0, 6))
    return tau, q


def logged(machine: Machine, q: Array, tau: Array) -> ExperimentLog:
    units = "rad" if all(machine.robot.revolute) else "rad or m"
    signals = {
        "t": Signal(machine.t, "s", "time"),
        "q": Signal(q, units, "position"),
        "tau": Signal(tau, "N m", "torque"),
    }
    return ExperimentLog(
        f"{machine.robot.name}",
        "excitation",
        "identify",
        "measured",
        machine.robot.name,
        float(machine.t[1] - machine.t[0]),
        format_robot(machine.told),
        signals,
        torque="measured",
    )


@dataclass(frozen=True, eq=False)
class Identifiable:
    """Bound on what any estimator finds of gravity, by Pinocchio's regressor and the true noise.

    It sees white noise of known power; the links are free, and friction is a smooth function of
    speed. What that leaves open, no log of this motion tells.
    """

    free: Array  # (4, n N, 10 n) columns over noise: without gravity, and 1 m/s^2 along x, y, z
    links: Array  # (10 n,) as they are

    @classmethod
    def of(cls, machine: Machine) -> Identifiable:
        import pinocchio as pin

        model = _pinocchio(machine.robot)
        data = model.createData()
        some = slice(None, None, max(1, len(machine.t) // 300))
        q, dq, ddq = machine.q[some], machine.dq[some], machine.ddq[some]
        parts = []
        for gravity in (np.zeros(3), *np.eye(3)):
            model.gravity.linear = gravity
            moving = (dq, ddq) if not gravity.any() else (0 * dq, 0 * ddq)
            columns = [
                pin.computeJointTorqueRegressor(model, data, *one).copy()
                for one in zip(q, *moving, strict=True)
            ]
            parts.append(np.transpose(columns, (1, 0, 2)))
        free = np.array(parts)
        for j in range(q.shape[1]):
            speed = dq[:, j]
            size = np.abs(speed) / np.sqrt(np.mean(speed**2))
            sign = np.tanh(speed / machine.friction["width"][j])
            laws = [sign * size**power for power in (0.0, 0.5, 1.0, 1.5, 2.0)]
            own = np.stack([ddq[:, j], *laws, 1 + 0 * speed], axis=-1)
            basis = np.linalg.qr(own)[0]
            free[:, j] -= basis @ (basis.T @ free[:, j])
            free[:, j] *= np.sqrt(len(machine.t) / len(q)) / machine.noise[j]
        links = np.concatenate([one.toDynamicParameters() for one in list(model.inertias)[1:]])
        return cls(free.reshape(4, -1, free.shape[-1]), links)

    def columns(self, gravity: Array) -> Array:
        return np.asarray(self.free[0] + np.tensordot(gravity, self.free[1:], 1))

    def explained(self, true: Array, other: Array) -> bool:
        """Return whether other links under `other` explain the torque under `true` so well that its
        noise leaves odds below those that decide.
        """
        return self.leaves(other, self.columns(true) @ self.links) < ODDS

    def leaves(self, gravity: Array, target: Array) -> float:
        """Power of the torque `target` over the noise that no links under `gravity` explain."""
        columns = self.columns(gravity)
        scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-9)
        left = target - columns @ (np.linalg.lstsq(columns / scale, target, 1e-9)[0] / scale)
        return float(left @ left)

    def direction(self, true: Array) -> bool:
        """Return whether the direction is determined: rank of the torque's change with it, and no
        other direction of gravity explains the torque.
        """
        along = true / np.linalg.norm(true)
        across = np.linalg.svd(along[None])[2][1:]
        columns = self.columns(true)
        change = np.tensordot(9.81 * across, self.free[1:], 1) @ self.links
        scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-9)
        fit = np.linalg.lstsq(columns / scale, change.T, 1e-9)[0]
        left = change.T - columns / scale @ fit
        if np.linalg.svd(left)[1][-1] < 1e-6 * np.linalg.norm(columns @ self.links):
            return False
        rng = np.random.default_rng(0)
        others = [
            -along,
            *across,
            *-across,
            *(v / np.linalg.norm(v) for v in rng.normal(size=(30, 3))),
        ]
        ring = np.radians(5.0)
        for turn in np.linspace(0, 2 * np.pi, 12, endpoint=False):
            side = np.cos(turn) * across[0] + np.sin(turn) * across[1]
            others.append(np.cos(ring) * along + np.sin(ring) * side)
        return not any(
            self.explained(true, 9.81 * v) for v in others if v @ along < np.cos(0.99 * ring)
        )


def _exchangeable(machine: Machine, gravity: Array) -> bool:
    """Return whether the torque is explained as well if two joints are taken for each other."""
    could = Identifiable.of(machine)
    n = len(machine.noise)
    torque = (could.columns(gravity) @ could.links).reshape(n, -1)
    for a, b in combinations(range(n), 2):
        order = np.arange(n)
        order[[a, b]] = b, a
        changed = replace(
            machine,
            q=machine.q[:, order],
            dq=machine.dq[:, order],
            ddq=machine.ddq[:, order],
            noise=machine.noise[order],
            friction={name: value[order] for name, value in machine.friction.items()},
        )
        if Identifiable.of(changed).leaves(gravity, torque[order].ravel()) < ODDS:
            return True
    return False


def _dissipated(machine: Machine, log: ExperimentLog, rigid: Array, friction: Array) -> list[float]:
    """<friction · speed> / (rms torque · rms speed) of each joint, at the moments that are
    fitted.
    """
    motion = sample_motion(Subject(log).good)
    if motion is None:
        return [float("nan")] * rigid.shape[1]
    at = np.searchsorted(machine.t, motion.t - 1e-9)
    tau, speed = (rigid + friction)[at], machine.dq[at]
    scale = np.sqrt(np.mean(tau**2, axis=0) * np.mean(speed**2, axis=0))
    return np.asarray(np.mean(friction[at] * speed, axis=0) / scale).tolist()


def judged(seed: int, kind: str, fault: str = "healthy") -> dict[str, Any]:
    """Return what is right of the boundary of one log: of each field "right", "wrong" or "null",
    and "false" claims.
    """
    log, truth = case(seed, kind, fault)
    began = process_time()
    found = torque_boundary([log])
    cpu = process_time() - began
    out: dict[str, Any] = {
        "seed": seed,
        "kind": kind,
        "fault": fault,
        "family": truth["family"],
        "joints": truth["n"],
        "cpu": cpu,
    }
    if found is None:
        return out | {"none": True}
    could = Identifiable.of(draw(seed))
    pointing = np.array(truth["direction"])
    blind = not could.direction(pointing)
    mute = could.explained(*((pointing, 0 * DOWN) if truth["gravity"] else (0 * DOWN, DOWN)))
    out["sign"] = _field(found.sign, "signed" if truth["sign"] else "magnitude")
    claims = {
        "order": bool(found.order.signal),
        "gravity": found.without_gravity,
        "turned": found.turned,
        "sign": found.sign == "magnitude",
        "friction": found.friction.present is False,
    }
    out["alarms"] = [
        name for name, claimed in claims.items() if claimed and name != CLAIM.get(kind)
    ]
    if kind == "magnitude":
        return out
    out |= _shares(found, truth) | {"blind": blind, "mute": mute}
    out["vectors"] = [found.direction.best, truth["direction"]]
    out["orders"] = [found.order.columns, truth["order"]]
    out["gravity"] = _told(found.gravity.present, truth["gravity"], mute)
    out["friction"] = _told(found.friction.present, truth["friction"], False)
    out["direction"] = _direction(found, truth, blind)
    told = None if found.order.reason else found.order.columns
    columns = None if told is None else [k - 1 for k in told]
    free = columns is None and _exchangeable(draw(seed), pointing if truth["gravity"] else 0 * DOWN)
    out["order"], out["exchangeable"] = _told(columns, truth["order"], free), free
    out["gate"] = claims.get(CLAIM.get(kind, ""), True) or (
        (mute and kind == "no gravity") or (blind and kind != "permuted")
    )
    return out


def _shares(found: Boundary, truth: dict[str, Any]) -> dict[str, Any]:
    """Shares, their standard deviations and what is true, and why a field is null."""
    gravity, friction = found.gravity, found.friction
    return {
        "share": gravity.share,
        "std": gravity.std,
        "why": [gravity.reason, friction.reason, found.direction.reason, found.order.reason],
    }


def _direction(found: Boundary, truth: dict[str, Any], blind: bool) -> str:
    vector = found.direction.vector
    if not truth["gravity"]:
        return "right" if vector is None else "wrong"
    if vector is None:
        return _told(None, True, blind)
    size = np.linalg.norm(vector) * np.linalg.norm(truth["direction"])
    near = np.array(vector) @ truth["direction"] > np.cos(np.radians(5)) * size
    return "right" if near else "wrong"


def _field(told: object, true: object) -> str:
    return "null" if told is None else "right" if told == true else "wrong"


def _told(told: object, true: object, blind: bool) -> str:
    """Return "right" for null where no log can determine the value."""
    return "right" if told is None and blind else _field(told, true)


def table(results: Iterable[dict[str, Any]]) -> str:
    """Return rates of every field and of false claims, with Wilson intervals."""
    rows = list(results)
    lines = []
    for field in ("gravity", "friction", "sign", "direction", "order"):
        said = [r[field] for r in rows if field in r and r["fault"] == "healthy"]
        lines.append(
            _rate(f"{field} right", sum(s == "right" for s in said), len(said))
            + f", wrong {said.count('wrong')}, null {said.count('null')}"
        )
    for kind in KINDS[1:]:
        own = [r for r in rows if r["kind"] == kind and "gate" in r]
        if own:
            lines.append(
                _rate(f"gate or field of '{kind}'", sum(bool(r["gate"]) for r in own), len(own))
            )
    whole = [r for r in rows if r["kind"] == "whole" and "alarms" in r]
    by_fault: dict[str, list[bool]] = defaultdict(list)
    for r in whole:
        by_fault[r["fault"]].append(bool(r["alarms"]))
    lines += [
        _rate(f"false claim on whole torque, {fault}", sum(bad), len(bad))
        for fault, bad in sorted(by_fault.items())
    ]
    permuted = [r["order"] for r in rows if r["kind"] == "permuted" and "order" in r]
    lines.append(_rate("order right of permuted logs", permuted.count("right"), len(permuted)))
    healthy = [r for r in rows if "share" in r and r["fault"] == "healthy"]
    shares = {
        "gravity": [(r["share"], r["std"], r["kind"] != "no gravity") for r in healthy],
    }
    for name, values in shares.items():
        inside = [abs(x - true) < 2 * std for x, std, true in values if x is not None]
        lines.append(_rate(f"{name} within two deviations", sum(inside), len(inside)))
    cpu = [r["cpu"] for r in rows]
    lines.append(f"CPU a log: median {np.median(cpu):.2f} s, largest {max(cpu):.2f} s")
    return "\n".join(lines)


def _rate(name: str, hits: int, total: int) -> str:
    low, high = wilson(hits, total)
    return (
        f"{name:44s} {hits:4d} of {total:4d} = {hits / max(total, 1):.3f} [{low:.3f}, {high:.3f}]"
    )


def main() -> None:
    """Judge the machines that the file of results lacks, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--count", type=int, default=200, help="machines")
    parser.add_argument("--first", type=int, default=5000, help="first seed")
    parser.add_argument("--out", type=Path, default=Path("torque_boundary.jsonl"))
    parser.add_argument("--faults", type=int, default=0, help="faults a machine, of whole torque")
    wanted = parser.parse_args()
    done = (
        [json.loads(line) for line in wanted.out.read_text().splitlines()]
        if wanted.out.exists()
        else []
    )
    known = {(r["seed"], r["kind"], r["fault"]) for r in done}
    with wanted.out.open("a") as file:
        for seed in range(wanted.first, wanted.first + wanted.count):
            cases = [(kind, "healthy") for kind in KINDS]
            cases += [
                ("whole", FAULTS[1 + (seed + k) % (len(FAULTS) - 1)]) for k in range(wanted.faults)
            ]
            for kind, fault in cases:
                if (seed, kind, fault) not in known:
                    done.append(judged(seed, kind, fault))
                    file.write(json.dumps(done[-1]) + "\n")
                    file.flush()
    print(table(r for r in done if wanted.first <= r["seed"] < wanted.first + wanted.count))


if __name__ == "__main__":
    main()
