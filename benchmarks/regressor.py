"""The regressor of a serial arm beside the usual Pinocchio loop. Goal: ×2.5 on six joints
(performance.md).

    python -m benchmarks.regressor [--samples 10000 100000]

Theirs is one loop that fills one preallocated matrix. Ours, three ways:

    all columns      every standard parameter, into one preallocated array stored samples-fastest
    base, in blocks  only the columns a fit needs, streamed as a fit takes them; Pinocchio cannot
                     leave out any
    peer's layout    every column, copied into the peer's matrix (samples · joints, 10 · joints)

Errors are those of the torque Y φ of the known links, relative to the largest torque, against a
Newton-Euler recursion in extended precision, in the base frame, written out below.
"""

from __future__ import annotations

from benchmarks.side_by_side import HEADER, race, row  # isort: skip  # before numpy

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from pipelines.dynamics import chain as serial
from pipelines.dynamics.base_parameters import BaseArm
from pipelines.dynamics.body import standard_parameters
from pipelines.dynamics.kinematics import SerialChain
from pipelines.io.robot import RobotDescription
from pipelines.io.robot_files import load_robot
from pipelines.io.urdf import import_urdf

_TX40 = Path(__file__).resolve().parents[2] / "shared" / "real" / "tx40" / "tx40.urdf"
_JUDGED = 2000  # samples whose torque is checked


@dataclass(frozen=True)
class Peer:
    """Pinocchio's model of an arm, and its own parameters of the same links."""

    model: Any
    phi: np.ndarray  # (joints * 10,)

    def fill(self, out: np.ndarray, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> None:
        model, data, nv = self.model, self.model.createData(), self.model.nv
        for k in range(len(q)):
            out[k * nv : (k + 1) * nv] = pin.computeJointTorqueRegressor(
                model, data, q[k], dq[k], ddq[k]
            )


def tx40() -> tuple[RobotDescription, Any]:
    return import_urdf(_TX40), pin.buildModelFromUrdf(str(_TX40))


def rrr() -> tuple[RobotDescription, Any]:
    """Return the paper's arm, built joint by joint from its distal DH table."""
    robot, model, behind = load_robot("rrr"), pin.Model(), pin.SE3.Identity()
    for i, joint in enumerate(robot.joints):
        model.addJoint(i, pin.JointModelRZ(), behind, joint.name)
        behind = pin.SE3(pin.utils.rotate("x", joint.alpha), np.array([joint.a, 0.0, joint.d]))
        m, mx, my, mz, xx, yy, zz, xy, xz, yz = standard_parameters(
            [joint.link] if joint.link else []
        )
        model.inertias[i + 1] = behind.act(
            pin.Inertia.FromDynamicParameters(np.array([m, mx, my, mz, xx, -xy, yy, -xz, -yz, zz]))
        )
    model.gravity.linear = np.array(robot.gravity)
    return robot, model


def exact_torque(
    chain: SerialChain, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, phi: np.ndarray
) -> np.ndarray:
    """τ (samples, joints) in extended precision: motion and momentum of every link, all in the base
    frame.
    """
    long = np.longdouble
    r, p = np.tile(np.eye(3, dtype=long), (len(q), 1, 1)), np.zeros((len(q), 3), dtype=long)
    w, alpha, a = (np.zeros((len(q), 3), dtype=long) for _ in range(3))
    a -= chain.gravity
    axes, anchors, moments, forces = [], [], [], []
    for i, values in enumerate(phi.reshape(-1, 10).astype(long)):
        lever = r @ chain.before[i].position.astype(long)
        a, p, r = (
            a + np.cross(alpha, lever) + np.cross(w, np.cross(w, lever)),
            p + lever,
            r @ chain.before[i].rotation,
        )
        axis = r[:, :, 2]
        angle, speed, rise = (
            q[:, i].astype(long) + chain.offset[i],
            dq[:, i, None].astype(long),
            ddq[:, i, None],
        )
        c, s, z = np.cos(angle), np.sin(angle), np.zeros(len(q), dtype=long)
        alpha, w = alpha + rise * axis + np.cross(w, speed * axis), w + speed * axis
        axes.append(axis)
        anchors.append(p)
        r = r @ np.array([[c, -s, z], [s, c, z], [z, z, z + 1]]).transpose(2, 0, 1)
        lever = r @ chain.after[i].position.astype(long)
        a, p, r = (
            a + np.cross(alpha, lever) + np.cross(w, np.cross(w, lever)),
            p + lever,
            r @ chain.after[i].rotation,
        )
        xx, yy, zz, xy, xz, yz = values[4:]
        inertia = (
            r @ np.array([[xx, -xy, -xz], [-xy, yy, -yz], [-xz, -yz, zz]]) @ r.transpose(0, 2, 1)
        )
        h = r @ values[1:4]
        force = values[0] * a + np.cross(alpha, h) + np.cross(w, np.cross(w, h))
        moment = (
            (inertia @ alpha[..., None])[..., 0]
            + np.cross(w, (inertia @ w[..., None])[..., 0])
            + np.cross(h, a)
        )
        forces.append(force)
        moments.append(moment + np.cross(p, force))
    return np.stack(
        [
            (axis * (sum(moments[j:]) - np.cross(anchor, sum(forces[j:])))).sum(axis=1)
            for j, (axis, anchor) in enumerate(zip(axes, anchors, strict=True))
        ],
        axis=1,
    )


def compare(name: str, robot: RobotDescription, model: Any, samples: int) -> list[str]:
    """Return the lines of one arm and one number of samples."""
    body, n = BaseArm(robot), robot.n_joints
    peer = Peer(
        model,
        np.concatenate([inertia.toDynamicParameters() for inertia in list(model.inertias)[1:]]),
    )
    phi = standard_parameters(
        [joint.link for joint in robot.joints if joint.link is not None]
    )
    motion = np.random.default_rng(7).uniform(-3.0, 3.0, (3, samples, n))
    theirs, copied = np.empty((samples * n, 10 * n)), np.empty((samples, n, 10 * n))
    kept = np.empty((n, 10 * n, samples))
    p = body.base.combine @ phi

    def copy() -> None:
        copied[:] = serial.regressor(body.chain, *motion, out=kept)

    few = motion[:, :_JUDGED]
    exact = exact_torque(body.chain, *few, phi)
    peer.fill(theirs, *motion)
    error = _error(theirs[: few.shape[1] * n] @ peer.phi, exact)
    ways: list[tuple[str, Callable[[], object], np.ndarray]] = [
        (
            "all columns",
            lambda: serial.regressor(body.chain, *motion, out=kept),
            serial.regressor(body.chain, *few) @ phi,
        ),
        (
            f"{len(p)} base columns",
            lambda: body.regressor(*motion),
            body.regressor(*few) @ p,
        ),
        ("peer's layout", copy, serial.regressor(body.chain, *few) @ phi),
    ]
    return [
        row(
            f"{name}, {samples:.0e}, {way}",
            race(run, lambda: peer.fill(theirs, *motion)),
            _error(tau, exact),
            error,
        )
        for way, run, tau in ways
    ]


def _error(tau: np.ndarray, exact: np.ndarray) -> float:
    return float(np.abs(tau.reshape(exact.shape) - exact).max() / np.abs(exact).max())


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--samples", type=int, nargs="+", default=[10_000, 100_000])
    print(HEADER)
    for samples in parser.parse_args().samples:
        for name, arm in (("TX40", tx40), ("RRR", rrr)):
            print("\n".join(compare(name, *arm(), samples)), flush=True)


if __name__ == "__main__":
    main()
