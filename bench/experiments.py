"""The experiments of a session: what moves, under which law, and what the log calls it. No name tells a fault.

    friction(machine, joint, seed)      open loop, both ways, speeds over two decades
    hold(machine, posture)              at rest
    excitation(machine, seed)           Fourier series (22), several periods
    free(machine, seed)                 slow sweeps;  reversal(machine, joint, seed): to and fro
    writing(reference, model)           the six control cases of Section IV.C.5
    frf(machine, joint, posture, model) computed torque with an injected excitation
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from bench import references
from bench.controllers import (
    FEEDFORWARD,
    ComputedTorque,
    ControllerModel,
    Decentralised,
    FeedForward,
    Law,
    OpenLoop,
)
from bench.machine import Machine
from bench.profiles import friction_torque, gravity_of, multisine, random_steps
from bench.reference import Reference, at_rest
from bench.rigid import RigidDynamics
from pipelines.io.experiment import Array

__all__ = ["WRITING_CASES", "Experiment", "excitation", "free", "frf", "frf_postures", "friction", "hold", "reversal", "writing"]

WRITING_CASES: tuple[tuple[str, ...], ...] = (
    (), ("friction",), ("friction", "inertia"), ("friction", "coriolis"), ("friction", "gravity"), FEEDFORWARD)


@dataclass(frozen=True, eq=False)
class Experiment:
    """One log to be."""

    name: str
    kind: str  # attribute `experiment` of the log
    reference: Reference
    law: Law
    role: str = "identify"
    joint: int | None = None  # 1-based, "friction" and "frf"
    posture: Array | None = None  # (n,) [rad]
    period: float | None = None  # [s]

    def judging(self) -> Experiment:
        """The same held out."""
        return replace(self, role="validate")

    def before(self) -> Experiment:
        """The same recorded when the machine was known to be in order."""
        return replace(self, role="reference", name=f"{self.name}-commissioning")


def friction(machine: Machine, joint: int, seed: int = 0, duration: float = 20.0, posture: Array | None = None) -> Experiment:
    """One joint (1-based) driven open loop, its gravity balanced from its position, the others held.

    The log has no reference: the held joints stay where the first sample has them, exactly, for the posture is a whole
    number of encoder steps.
    """
    rng = np.random.default_rng([31, seed, joint])
    steps = np.array([step or 1e-9 for step in machine.encoder_resolution])
    at = np.round((references.home(machine) if posture is None else posture) / steps) * steps
    torque = np.zeros((len(at_rest(at, duration).t), machine.n))
    torque[:, joint - 1] = friction_torque(machine, joint, at, rng, duration)
    gravity = np.zeros((machine.n, 2))
    gravity[joint - 1] = gravity_of(machine, joint, at)
    if not machine.robot.joints[joint - 1].revolute:
        torque[:, joint - 1] += gravity[joint - 1, 1]
        gravity[:] = 0.0
    gravity[np.abs(gravity) < 1e-9] = 0.0  # about an upright axis
    law = OpenLoop(torque, tuple(j == joint - 1 for j in range(machine.n)), gravity)
    return Experiment(f"friction-{joint}-{seed}", "friction", at_rest(at, duration), law, joint=joint)


def hold(posture: Array, number: int = 1, duration: float = 2.0) -> Experiment:
    """At rest in `posture` (n,)."""
    return Experiment(f"hold-{number}", "hold", at_rest(posture, duration), Decentralised(), posture=posture)


def excitation(machine: Machine, seed: int = 0, period: float = 10.0, periods: int = 2) -> Experiment:
    """All joints along a Fourier series."""
    reference = references.fourier(machine, np.random.default_rng([22, seed]), period, periods)
    return Experiment(f"excitation-{seed}", "excitation", reference, Decentralised(), period=period if periods > 1 else None)


def free(machine: Machine, seed: int = 0, duration: float = 20.0) -> Experiment:
    """All joints in slow sweeps of random speed."""
    reference = references.sweeps(machine, np.random.default_rng([23, seed]), duration)
    return Experiment(f"free-{seed}", "free", reference, Decentralised())


def reversal(machine: Machine, joint: int, duration: float = 8.0, posture: Array | None = None) -> Experiment:
    """One joint (1-based) to and fro over small angles."""
    at = references.home(machine) if posture is None else posture
    return Experiment(f"free-reversals-{joint}", "free", references.reversals(machine, joint, at, duration), Decentralised())


def writing(reference: Reference, model: ControllerModel, stiffness: float = 0.3, first: int = 1) -> tuple[Experiment, ...]:
    """A given task in the six control cases, held out; gains are weak, so that feed-forward shows."""
    laws: list[Law] = [FeedForward(model, parts, stiffness=stiffness) if parts else Decentralised(stiffness=stiffness)
                       for parts in WRITING_CASES]
    return tuple(Experiment(f"writing-{number}", "writing", reference, law, role="validate")
                 for number, law in enumerate(laws, start=first))


def frf_postures(machine: Machine) -> tuple[Array, ...]:
    """Postures (n,) to excite a joint in: stretched out, the last joint bent by a right angle, and one between."""
    low, high = np.array([joint.position for joint in machine.robot.joints]).T
    bent = np.zeros(machine.n)
    bent[-1] = 0.5 * np.pi if machine.robot.joints[-1].revolute else 0.1
    between = np.full(machine.n, 0.25 * np.pi) * np.array([joint.revolute for joint in machine.robot.joints])
    return tuple(np.clip(posture, low, high) for posture in (bent, np.zeros(machine.n), between))


def frf(machine: Machine, joint: int, posture: Array, model: ControllerModel, seed: int = 0, duration: float = 20.0,
        injected: Literal["multisine", "random"] = "multisine", natural_hz: float = 3.2, damping: float = 0.7) -> Experiment:
    """One joint (1-based) turning slowly there and back under computed torque and v: Section IV.D.

    v takes a tenth of the joint's torque (rms), and less where gravity leaves little.
    """
    rng = np.random.default_rng([29, seed, joint])
    reference = references.turning(machine, joint, posture, duration)
    inertia = float(RigidDynamics(machine.robot).mass_matrix(posture)[joint - 1, joint - 1])
    weight = float(np.hypot(*gravity_of(machine, joint, posture)))
    spare = machine.torque_limit[joint - 1] - weight - machine.friction[joint - 1].coulomb
    rms = min(0.1 * machine.torque_limit[joint - 1], max(spare, 0.0) / 4.5) / inertia
    v = np.zeros_like(reference.q)
    draw = multisine if injected == "multisine" else random_steps
    v[:, joint - 1] = draw(rng, reference.samples, rms)
    w = 2.0 * np.pi * natural_hz
    law = ComputedTorque(model, v, (w**2,) * machine.n, (2.0 * damping * w,) * machine.n)
    return Experiment(f"frf-{joint}-{seed}", "frf", reference, law, joint=joint, posture=posture)
