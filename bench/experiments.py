"""The experiments of a session: what moves and under which law. No name tells a fault.

friction(machine, joint, seed)      open loop, both ways, speeds over two decades
hold(posture)                       at rest
excitation(machine, seed)           Fourier series (22), several periods
free(machine, seed)                 slow sweeps;  reversal(machine, joint): to and fro
writing(reference, model)           the six control cases of Section IV.C.5
frf(machine, joint, posture, model) computed torque with an injected excitation
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bench import motions
from bench.config import CONFIG
from bench.control import (
    FEEDFORWARD,
    ComputedTorque,
    ControllerModel,
    Decentralised,
    FeedForward,
    Law,
    OpenLoop,
)
from bench.dynamics import RigidDynamics
from bench.machine import Machine
from bench.motions import Reference, at_rest
from pipelines.io.log import Array

WRITING_CASES: tuple[tuple[str, ...], ...] = (
    (),
    ("friction",),
    ("friction", "inertia"),
    ("friction", "coriolis"),
    ("friction", "gravity"),
    FEEDFORWARD,
)


@dataclass(frozen=True, eq=False)
class Experiment:
    """A log to be recorded."""

    name: str
    kind: str  # attribute `experiment` of the log
    reference: Reference
    law: Law
    role: str = "identify"
    joint: int | None = None  # 1-based, "friction" and "frf"
    posture: Array | None = None  # (n,) [rad]
    period: float | None = None  # [s]

    def judging(self) -> Experiment:
        """Return the same, held out."""
        return replace(self, role="validate")

    def before(self) -> Experiment:
        """Return the same, recorded when the machine was known to be healthy."""
        return replace(self, role="reference", name=f"{self.name}-commissioning")


def friction(
    machine: Machine,
    joint: int,
    seed: int = 0,
    duration: float = 20.0,
    posture: Array | None = None,
) -> Experiment:
    """Drive one joint (1-based) open loop, its gravity balanced from its position, the others held.

    The log has no reference: the held joints stay where the first sample has them, exactly, for the
    posture is a whole number of encoder steps.
    """
    rng = np.random.default_rng([31, seed, joint])
    steps = np.array([step or 1e-9 for step in machine.encoder_resolution])
    wanted = motions.home(machine) if posture is None else posture
    reference = at_rest(np.round(wanted / steps) * steps, duration)
    at, j = reference.q[0], joint - 1
    torque = np.zeros((reference.samples, machine.n))
    torque[:, j] = motions.friction_torque(machine, joint, at, rng, duration)
    gravity = np.zeros((machine.n, 2))
    gravity[j] = motions.gravity_of(machine, joint, at)
    if not machine.robot.joints[j].revolute:
        torque[:, j] += gravity[j, 1]
        gravity[:] = 0.0
    gravity[np.abs(gravity) < CONFIG.least_gravity] = 0.0
    law = OpenLoop(torque, tuple(i == j for i in range(machine.n)), gravity)
    return Experiment(f"friction-{joint}-{seed}", "friction", reference, law, joint=joint)


def hold(posture: Array, number: int = 1, duration: float = 2.0) -> Experiment:
    """Rest in `posture` (n,) [rad]."""
    reference = at_rest(posture, duration)
    return Experiment(f"hold-{number}", "hold", reference, Decentralised(), posture=posture)


def excitation(
    machine: Machine, seed: int = 0, period: float = 10.0, periods: int = 2
) -> Experiment:
    """Move all joints along a Fourier series of `period` [s]."""
    reference = motions.fourier(machine, np.random.default_rng([22, seed]), period, periods)
    known = period if periods > 1 else None
    return Experiment(f"excitation-{seed}", "excitation", reference, Decentralised(), period=known)


def free(machine: Machine, seed: int = 0, duration: float = 20.0) -> Experiment:
    """Move all joints in slow sweeps of random speed."""
    reference = motions.sweeps(machine, np.random.default_rng([23, seed]), duration)
    return Experiment(f"free-{seed}", "free", reference, Decentralised())


def reversal(machine: Machine, joint: int, duration: float = 8.0) -> Experiment:
    """Move one joint (1-based) to and fro over small angles."""
    reference = motions.reversals(joint, motions.home(machine), duration)
    return Experiment(f"free-reversals-{joint}", "free", reference, Decentralised())


def writing(
    reference: Reference, model: ControllerModel, stiffness: float = 0.3
) -> tuple[Experiment, ...]:
    """Follow a task in the six control cases, held out, at weak gains that show feed-forward."""
    laws: list[Law] = [Decentralised(stiffness=stiffness)]
    laws += [FeedForward(model, parts, stiffness=stiffness) for parts in WRITING_CASES[1:]]
    return tuple(
        Experiment(f"writing-{number}", "writing", reference, law, role="validate")
        for number, law in enumerate(laws, start=1)
    )


def frf_postures(machine: Machine) -> tuple[Array, ...]:
    """Return postures (n,) for a response: last joint bent, stretched out, and one between."""
    low, high = np.array([joint.position for joint in machine.robot.joints]).T
    bent = np.zeros(machine.n)
    bent[-1] = 0.5 * np.pi if machine.robot.joints[-1].revolute else 0.1
    turning = np.array([joint.revolute for joint in machine.robot.joints])
    between = np.full(machine.n, 0.25 * np.pi) * turning
    return tuple(np.clip(posture, low, high) for posture in (bent, np.zeros(machine.n), between))


def frf(
    machine: Machine,
    joint: int,
    posture: Array,
    model: ControllerModel,
    seed: int = 0,
    duration: float = 20.0,
) -> Experiment:
    """Turn one joint (1-based) under computed torque and a multisine v: Section IV.D.

    v takes a tenth of the joint's torque (rms), and less where gravity leaves little. The loops
    have a natural frequency of 3.2 Hz and a damping ratio of 0.7.
    """
    rng, j = np.random.default_rng([29, seed, joint]), joint - 1
    reference = motions.turning(machine, joint, posture, duration)
    inertia = float(RigidDynamics(machine.robot).mass_matrix(posture)[j, j])
    weight = float(np.hypot(*motions.gravity_of(machine, joint, posture)))
    spare = machine.torque_limit[j] - weight - machine.friction[j].coulomb
    rms = min(0.1 * machine.torque_limit[j], max(spare, 0.0) / 4.5) / inertia
    v = np.zeros_like(reference.q)
    v[:, j] = motions.multisine(rng, reference.samples, rms)
    w = 2.0 * np.pi * 3.2
    law = ComputedTorque(model, v, (w**2,) * machine.n, (2.0 * 0.7 * w,) * machine.n)
    return Experiment(f"frf-{joint}-{seed}", "frf", reference, law, joint=joint, posture=posture)
