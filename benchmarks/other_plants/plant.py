"""Simulate MuJoCo's bodies under a held torque, with friction, drive, encoder and faults in plain
numpy.

    plant = Plant(arm, Friction("lugre", …), (Fault("cogging", 1, 0.4),), noise, …)
    q, tau = plant.run(loop, motion, sample_time, rng)     (samples, joints) what a log holds

MuJoCo integrates by Runge-Kutta with many steps a sample; what rubs, pulls or sticks is asked for
at each of its stages.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from benchmarks.other_plants.arms import Arm
from benchmarks.other_plants.faults import Fault, Now, Several
from benchmarks.other_plants.friction import Friction
from benchmarks.other_plants.loops import Loop
from pipelines.io.log import Array

_LONGEST = 5e-4  # [s] of a step
_STABLE = 1.0  # steps a time constant of the stiffest joint: Runge-Kutta 4 bears 2.78
_FASTEST_HZ = 25.0  # of coloured noise


@dataclass(frozen=True, eq=False)
class Plant:
    """An arm with all that acts on it."""

    arm: Arm
    friction: Friction
    faults: tuple[Fault, ...]
    noise: Array  # [N m] (joints,) of the drives, rms
    coloured: bool
    resolution: Array  # [rad] (joints,) of the encoders

    def run(
        self,
        loop: Loop,
        path: tuple[Array, Array, Array],
        sample_time: float,
        rng: np.random.Generator,
    ) -> tuple[Array, Array]:
        """Return encoder readings and commands (samples, joints) along `path`."""
        state = _State(self, loop.inertia, sample_time, rng, path[0].shape)
        data = state.data
        data.qpos[:], data.qvel[:] = path[0][0], path[1][0]
        read, commanded = np.empty_like(path[0]), np.empty_like(path[0])
        mujoco.set_mjcb_passive(state.passive)
        try:
            for k, (q_ref, dq_ref, ddq_ref) in enumerate(zip(*path, strict=True)):
                read[k] = self.resolution * np.rint(state.acting.seen(data.qpos) / self.resolution)
                commanded[k] = loop(q_ref, dq_ref, ddq_ref, read[k])
                state.advance(commanded[k])
        finally:
            mujoco.set_mjcb_passive(None)
        return read, state.acting.logged(commanded)


class _State:
    """One run: what friction, drive and fault remember."""

    def __init__(
        self,
        plant: Plant,
        inertia: Array,
        sample_time: float,
        rng: np.random.Generator,
        shape: tuple[int, ...],
    ) -> None:
        self.plant, self.rng = plant, rng
        law = plant.friction
        rate = (law.coulomb * law.breakaway / law.width + law.viscous) / inertia
        if law.kind == "lugre":  # a spring of so much a rad, with a damper
            self.stiff = law.coulomb / law.width
            self.damper = 0.5 * np.sqrt(self.stiff * inertia)
            rate = 2.0 * np.sqrt(self.stiff / inertia)
        self.steps = int(np.ceil(sample_time / min(_LONGEST, _STABLE / float(rate.max()))))
        self.h = sample_time / self.steps
        tilt, towards = next(
            ((one.size, one.number) for one in plant.faults if one.kind == "gravity_tilt"),
            (0.0, 0.0),
        )  # [rad]
        payload = sum(one.size for one in plant.faults if one.kind == "payload")
        down = np.cos(tilt) * np.array(plant.arm.gravity) + 9.81 * np.sin(tilt) * np.array(
            [np.cos(towards), np.sin(towards), 0.0]
        )
        self.model = plant.arm.model(self.h, tuple(down.tolist()), payload=payload)
        self.data: Any = mujoco.MjData(self.model)
        self.z = np.zeros(shape[1])
        self.acting = Several(plant.faults, law, sample_time, rng)
        self.applied = np.zeros(shape[1])
        self.blur = np.zeros(shape[1])
        self.share = 1.0 - np.exp(-2.0 * np.pi * _FASTEST_HZ * sample_time)

    def advance(self, command: Array) -> None:
        """One sample under `command`."""
        self.applied = self.acting.driven(command) + self._noise()
        self.data.qfrc_applied[:] = self.applied
        for _ in range(self.steps):
            mujoco.mj_step(self.model, self.data)
            if self.plant.friction.kind == "lugre":
                self._bend()
        self.acting.after(self.applied, self.data.qvel)

    def _noise(self) -> Array:
        """White, or through a low-pass of first order; of the same rms."""
        white = self.plant.noise * self.rng.standard_normal(len(self.z))
        if not self.plant.coloured:
            return np.asarray(white)
        self.blur = self.blur + self.share * (white - self.blur)
        return np.asarray(self.blur * np.sqrt(2.0 / self.share - 1.0))

    def _bend(self) -> None:
        """Bristles of LuGre over one step, exact for a steady speed: dz/dt = v - σ0 |v| z/g(v).
        Canudas de Wit et al. 1995, (2).
        """
        v = self.data.qvel
        rate = self.stiff * np.abs(v) / self.plant.friction.level(v)
        self.z = self.z * np.exp(-rate * self.h) + v * self.h * np.where(
            rate > 1e-9, -np.expm1(-rate * self.h) / np.maximum(rate * self.h, 1e-12), 1.0
        )

    def passive(self, model: Any, data: Any) -> None:
        """All that acts beside the drives, at one stage of the integrator."""
        v, law = data.qvel, self.plant.friction
        if law.kind == "lugre":
            bent = v - self.stiff * np.abs(v) / law.level(v) * self.z
            dry = self.stiff * self.z + self.damper * bent * np.exp(-((v / law.slow) ** 2))
        else:
            dry = law.dry(v)
        now = Now(data.time, data.qpos, v, dry, self.applied, self._pushed)
        data.qfrc_passive[:] = self.acting.load(now) - dry - law.viscous * v

    def _pushed(self, force: Array) -> Array:
        """[N m] what a force [N] in the base frame at the tip does to the joints."""
        last = self.model.nbody - 1
        slopes = np.zeros((3, self.model.nv))
        tip = self.data.xpos[last] + 2.0 * (self.data.xipos[last] - self.data.xpos[last])
        mujoco.mj_jac(self.model, self.data, slopes, None, tip, last)
        return np.asarray(slopes.T @ force)
