"""What moves: MuJoCo's bodies under a held torque, with friction, drive, encoder and one fault in plain numpy.

    plant = Plant(arm, Friction("lugre", …), Fault("cogging", 1, 0.4), noise, …)
    q, tau = plant.run(loop, motion, sample_time, rng)     (samples, joints) what a log holds

MuJoCo integrates by Runge-Kutta with many steps a sample; what rubs, pulls or sticks is asked for at each of its stages.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from benchmarks.other_plants.arms import Arm
from benchmarks.other_plants.loops import Loop
from pipelines.log.experiment import Array

__all__ = ["Fault", "Friction", "Plant"]

_LONGEST = 5e-4  # [s] of a step
_STABLE = 1.0  # steps a time constant of the stiffest joint: Runge-Kutta 4 bears 2.78
_FASTEST_HZ = 25.0  # of coloured noise
_HEATING, _HOPS = 5.0, 0.7  # [s] time constant of a gear that warms, mean time between two hops


@dataclass(frozen=True, eq=False)
class Friction:
    """A law of dry friction for all joints, and viscous friction. All (joints,)."""

    kind: str  # "tanh", "root", "arctan", "stribeck", "lugre"
    coulomb: Array  # [N m]
    viscous: Array  # [N m s/rad]
    width: Array  # [rad/s] over which dry friction changes its sign; of "lugre" [rad] of presliding
    slow: Array  # [rad/s] Stribeck's speed of "stribeck" and "lugre"
    breakaway: float = 1.5  # of the Coulomb friction, in "stribeck" and "lugre"

    def dry(self, v: Array) -> Array:
        """Friction without memory [N m]."""
        if self.kind == "root":
            sign = v / np.sqrt(v * v + self.width**2)
        elif self.kind == "arctan":
            sign = 2.0 / np.pi * np.arctan(v / self.width)
        else:
            sign = np.tanh(v / self.width)
        return self.level(v) * sign

    def level(self, v: Array) -> Array:
        """Dry friction at a steady speed [N m]."""
        if self.kind not in ("stribeck", "lugre"):
            return self.coulomb
        return self.coulomb * (1.0 + (self.breakaway - 1.0) * np.exp(-(v / self.slow) ** 2))


@dataclass(frozen=True)
class Fault:
    """What is wrong, at one joint (from 0) or none; `size` in the unit of its kind."""

    kind: str
    joint: int = 0
    size: float = 0.0
    number: float = 0.0  # of cogging: order [1/rad or 1/m]; of what comes from another joint: which


@dataclass(frozen=True, eq=False)
class Plant:
    """An arm with all that acts on it."""

    arm: Arm
    friction: Friction
    fault: Fault | None
    noise: Array  # [N m] (joints,) of the drives, rms
    coloured: bool
    resolution: Array  # [rad] (joints,) of the encoders

    def run(self, loop: Loop, path: tuple[Array, Array, Array], sample_time: float,
            rng: np.random.Generator) -> tuple[Array, Array]:
        """Encoder readings and commands (samples, joints) along `path`."""
        state = _State(self, loop.inertia, sample_time, rng, path[0].shape)
        data = state.data
        data.qpos[:], data.qvel[:] = path[0][0], path[1][0]
        read, commanded = np.empty_like(path[0]), np.empty_like(path[0])
        mujoco.set_mjcb_passive(state.passive)
        try:
            for k, (q_ref, dq_ref, ddq_ref) in enumerate(zip(*path, strict=True)):
                read[k] = self.resolution * np.rint(data.qpos / self.resolution)
                commanded[k] = loop(q_ref, dq_ref, ddq_ref, read[k])
                state.advance(commanded[k])
        finally:
            mujoco.set_mjcb_passive(None)
        return read, commanded


class _State:
    """One run: what friction, drive and fault remember."""

    def __init__(self, plant: Plant, inertia: Array, sample_time: float, rng: np.random.Generator, shape: tuple[int, ...]) -> None:
        self.plant, self.rng, fault = plant, rng, plant.fault
        law = plant.friction
        rate = (law.coulomb * law.breakaway / law.width + law.viscous) / inertia
        if law.kind == "lugre":  # a spring of so much a rad, with a damper
            self.stiff = law.coulomb / law.width
            self.damper = 0.5 * np.sqrt(self.stiff * inertia)
            rate = 2.0 * np.sqrt(self.stiff / inertia)
        self.steps = int(np.ceil(sample_time / min(_LONGEST, _STABLE / float(rate.max()))))
        self.h = sample_time / self.steps
        self.kind, self.joint, self.size, self.number = ("", 0, 0.0, 0.0) if fault is None else (
            fault.kind, fault.joint, fault.size, fault.number)
        tilt = self.size if self.kind == "gravity_tilt" else 0.0  # [rad] towards `number` [rad] from the base's x axis
        towards = np.array([np.cos(self.number), np.sin(self.number), 0.0])
        down = np.cos(tilt) * np.array(plant.arm.gravity) + 9.81 * np.sin(tilt) * towards
        self.model = plant.arm.model(self.h, tuple(down.tolist()), payload=self.size if self.kind == "payload" else 0.0)
        self.data: Any = mujoco.MjData(self.model)
        self.z = np.zeros(shape[1])
        self.heat, self.hop, self.time = 0.0, 1.0, 0.0
        self.applied = np.zeros(shape[1])
        self.late = deque([np.zeros(shape[1])] * (round(self.size / sample_time) if self.kind == "torque_delay" else 0))
        self.blur = np.zeros(shape[1])
        self.share = 1.0 - np.exp(-2.0 * np.pi * _FASTEST_HZ * sample_time)
        self.lasting = sample_time

    def advance(self, command: Array) -> None:
        """One sample under `command`."""
        self.applied = self._driven(command) + self._noise()
        self.data.qfrc_applied[:] = self.applied
        for _ in range(self.steps):
            mujoco.mj_step(self.model, self.data)
            if self.plant.friction.kind == "lugre":
                self._bend()
        self.time += self.lasting
        if self.kind == "heat from another joint":
            other = int(self.number)
            power = abs(self.applied[other] * self.data.qvel[other]) / self.size
            self.heat += self.lasting / _HEATING * (power - self.heat)
        if self.kind == "hopping torque" and self.rng.random() < self.lasting / _HOPS:
            self.hop = -self.hop

    def _driven(self, command: Array) -> Array:
        """What the drives make of the command."""
        if self.kind == "torque_delay":
            if self.time == 0.0:
                self.late = deque([command] * len(self.late))
            self.late.append(command)
            return np.array(self.late.popleft())
        made, j = command.copy(), self.joint
        if self.kind == "torque_gain":
            made[j] *= 1.0 + self.size
        elif self.kind == "torque_crosstalk":
            made[j] += self.size * command[int(self.number)]
        return made

    def _noise(self) -> Array:
        """White, or through a low-pass of first order; of the same rms."""
        white = self.plant.noise * self.rng.standard_normal(len(self.z))
        if not self.plant.coloured:
            return np.asarray(white)
        self.blur = self.blur + self.share * (white - self.blur)
        return np.asarray(self.blur * np.sqrt(2.0 / self.share - 1.0))

    def _bend(self) -> None:
        """Bristles of LuGre over one step, exact for a steady speed: dz/dt = v - σ0 |v| z/g(v). Canudas de Wit et al. 1995, (2)."""
        v = self.data.qvel
        rate = self.stiff * np.abs(v) / self.plant.friction.level(v)
        self.z = self.z * np.exp(-rate * self.h) + v * self.h * np.where(rate > 1e-9, -np.expm1(-rate * self.h) /
                                                                         np.maximum(rate * self.h, 1e-12), 1.0)

    def passive(self, model: Any, data: Any) -> None:
        """All that acts beside the drives, at one stage of the integrator."""
        q, v, law, j = data.qpos, data.qvel, self.plant.friction, self.joint
        if law.kind == "lugre":
            bent = v - self.stiff * np.abs(v) / law.level(v) * self.z
            dry = self.stiff * self.z + self.damper * bent * np.exp(-(v / law.slow) ** 2)
        else:
            dry = law.dry(v)
        load = -dry - law.viscous * v
        if self.kind == "asymmetric_friction":
            load[j] -= self.size * abs(np.tanh(v[j] / law.width[j]))
        elif self.kind == "load_friction":
            load[j] -= self.size * abs(self.applied[j]) * np.tanh(v[j] / law.width[j])
        elif self.kind == "viscous_drift":
            load[j] -= self.size * law.viscous[j] * v[j] * -np.expm1(-data.time / 6.0)
        elif self.kind == "heat from another joint":
            load[j] *= 1.0 + self.heat
        elif self.kind == "hopping torque":
            load[j] += self.hop * self.size
        elif self.kind == "torque_offset":
            load[j] += self.size
        elif self.kind == "cogging":
            load[j] += self.size * (np.sin(self.number * q[j] + 0.7) + 0.3 * np.sin(2.0 * self.number * q[j]))
        elif self.kind == "spring":
            away = q[j] - self.number
            load[j] -= self.size * (away + 0.1 * away**3)
        data.qfrc_passive[:] = load
