"""Arms to simulate and motions to follow, with Pinocchio's model of each."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.dynamics.base_parameters import BaseArm
from pipelines.dynamics.parameter import Parameter
from pipelines.dynamics.rrr import rigid_body
from pipelines.io.log import Array, Controller
from pipelines.simulation import Experiment
from sample_logs.make_model import FRICTION, synthetic_arm
from tests.dynamics import serial_arms
from tests.simulation.pinocchio_loop import Friction, three_sigmoids

TS = 1e-3  # [s]
KP, KD = np.array([1500.0, 1100.0, 140.0]), np.array([45.0, 32.0, 3.2])
GAIN = np.tile([0.4156, 109.13, 14328.0], (3, 1))  # k of eq. (20), about what 4000 rad/s^3 and 3e-6 rad ask for


@dataclass(frozen=True)
class Case:
    """Our arm, and Pinocchio's."""

    arm: Arm
    model: Any

    @property
    def n(self) -> int:
        return self.arm.n_joints


def rrr(friction: bool = True) -> Case:
    """The shipped RRR arm with its synthetic links."""
    theirs = serial_arms.ARMS["rrr"](Path(), Path())
    arm = synthetic_arm()
    theirs.load(_known(arm))
    return Case(arm if friction else Arm(arm.name, arm.body, arm.base), theirs.model)


def rrr_friction() -> Friction:
    """The friction of the shipped arm, for Pinocchio's loop."""
    f, w, b = (np.array(column) for column in zip(*FRICTION, strict=True))
    return three_sigmoids(f, w, b)


def serial(name: str, shared: Path, folder: Path, seed: int = 3) -> Case:
    """One of the arms of every kind, with random links that could exist."""
    theirs = serial_arms.ARMS[name](shared, folder)
    phi = serial_arms.physical_links(theirs.n, np.random.default_rng(seed))
    theirs.load(phi)
    body = rigid_body(theirs.robot)
    assert isinstance(body, BaseArm)
    base = tuple(Parameter(known.name, float(value), None, known.unit, origin="assumed")
                 for known, value in zip(body.parameters, body.base.combine @ phi, strict=True))
    return Case(Arm(name, body, base), theirs.model)


def _known(arm: Arm) -> Array:
    from pipelines.dynamics.body import standard_parameters

    return standard_parameters([joint.link for joint in arm.robot.joints if joint.link is not None])


def waving(samples: int, speed: float = 1.0) -> tuple[Array, Array, Array]:
    """q, dq, ddq (samples, 3): smooth, from rest, with reversals."""
    t = TS * np.arange(samples)[:, None]
    centre, size, w = np.array([0.2, -1.2, 0.8]), np.array([0.5, 0.4, 0.7]), 2 * math.pi * speed * np.array([0.8, 1.1, 1.7])
    return (centre + size * (1 - np.cos(w * t)), size * w * np.sin(w * t), size * w**2 * np.cos(w * t))


def experiment(controller: Controller, samples: int, **changes: Any) -> Experiment:
    """The RRR arm following `waving`, encoders that do not quantise."""
    q, dq, ddq = waving(samples)
    known: dict[str, Any] = {"sample_time": TS, "start_time": 0.0, "controller": controller, "q_ref": q, "dq_ref": dq,
                             "ddq_ref": ddq, "q0": q[0], "dq0": dq[0], "tau0": np.zeros(3), "resolution": np.zeros(3)}
    return Experiment(**(known | changes))
