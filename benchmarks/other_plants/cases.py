"""The cases: plain data, and what is drawn of it.

case = next(one for one in CASES if one.name == "gantry-cogging")
logs = case.logs()
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from benchmarks.other_plants.arms import ARMS, Arm
from benchmarks.other_plants.faults import Fault
from benchmarks.other_plants.friction import Friction
from benchmarks.other_plants.loops import Loop, motion
from benchmarks.other_plants.plant import Plant
from pipelines.io import schema
from pipelines.io.log import Array, ExperimentLog, Signal
from pipelines.io.robot import format_robot

Motions = tuple[tuple[str, str], ...]  # kind of motion, role of its log
FOUR: Motions = (
    ("fourier", "identify"),
    ("moves", "identify"),
    ("fourier", "validate"),
    ("moves", "validate"),
)
FIVE: Motions = (*FOUR[:2], ("ramps", "identify"), *FOUR[2:])
THREE: Motions = (("fourier", "identify"), ("fourier", "validate"), ("moves", "validate"))
BEFORE: Motions = (("fourier", "reference"), ("moves", "reference"))
_TOUCHED = 0  # number of the log in which something is touched
_SIZE = {
    "torque_offset": 0.1,
    "cogging": 0.1,
    "spring": 0.12,
    "hopping torque": 0.1,
}  # of the joint's typical torque


@dataclass(frozen=True)
class Case:
    """One arm, its loop, its motions, and what is wrong with it."""

    arm: str
    law: str  # of friction
    loop: str
    sample_time: float  # [s]
    resolution: float = 1e-5  # [rad or m] of the encoders; a tenth of it on slides
    noise: float = 0.004  # of the typical torque
    coloured: bool = False
    motions: Motions = FOUR
    duration: float = 12.0  # [s] of each log
    fault: str = ""
    joint: int = 1
    size: float = 0.0  # where the kind has no usual one
    number: float = 0.0
    answers: tuple[str, ...] = ()  # names that are right; none: a healthy arm, or an "unknown"
    geared: bool = True  # the description tells the gears
    number_in_name: int = 0
    beside: Case | None = None  # whose fault this arm has too

    @property
    def faults(self) -> tuple[Case, ...]:
        """This case, and the one whose fault is beside its own."""
        return (self,) if self.beside is None else (self, self.beside)

    @property
    def name(self) -> str:
        rest = f"-{self.number_in_name}" if self.number_in_name else ""
        faults = "+".join(one.fault or one.law for one in self.faults)
        return f"{self.arm}-{faults.replace(' ', '-')}{rest}"

    def logs(self) -> list[ExperimentLog]:
        """Everything that was recorded, the reference logs without the fault."""
        seed = zlib.crc32(self.name.encode())
        rng = np.random.default_rng(seed)
        arm = ARMS[self.arm].varied(rng)
        typical, speed, inertia = _scales(arm, rng)
        law = _friction(self.law, typical, speed, rng)
        typical = typical + law.coulomb
        resolution = np.array([self.resolution * (0.1 if axis.slide else 1.0) for axis in arm.axes])
        limit = np.ceil(6.0 * typical)
        robot = arm.described(tuple(resolution.tolist()), limit, self.geared)
        counts = 12.0 * typical / 2**13
        sick = [fault for one in self.faults if (fault := one._fault(typical, law, speed))]
        logs = []
        for place, (kind, role) in enumerate(self.motions):
            own = np.random.default_rng([seed, place])
            t: Array = np.arange(round(self.duration / self.sample_time)) * self.sample_time
            path = motion(kind, arm, t, own)
            cycle = min(5.0, 0.02 / self.sample_time)
            loop = Loop(self.loop, arm, self.sample_time, inertia, cycle, counts, limit)
            now = [one for one in sick if one.kind != "contact" or place == _TOUCHED]
            if role == "reference":
                now = []
            bodies, noise = self._bent(arm) if now else arm, self.noise * typical
            plant = Plant(bodies, law, tuple(now), noise, self.coloured, resolution)
            q, tau = plant.run(loop, path, self.sample_time, own)
            values = {"t": t + 3.0 * place, "q": q, "tau": tau}
            values |= dict(zip(("q_ref", "dq_ref", "ddq_ref"), path, strict=True))
            signals = {
                name: Signal(array, schema.unit_of(name, "pd"), schema.SIGNALS[name][1])
                for name, array in values.items()
            }
            log = ExperimentLog(
                name=f"{role}-{kind}-{place}",
                experiment="excitation" if kind == "fourier" else "free",
                role=role,
                origin="simulated",
                robot_name=robot.name,
                sample_time=self.sample_time,
                robot_text=format_robot(robot),
                signals=signals,
                controller=loop.told(),
            )
            logs.append(log)
        return logs

    def _fault(self, typical: Array, law: Friction, speed: Array) -> Fault | None:
        if not self.fault:
            return None
        j = self.joint - 1
        size, number = self.size or _SIZE.get(self.fault, 0.0) * float(typical[j]), self.number
        if self.fault in ("asymmetric_friction", "concave_friction"):
            size *= float(law.coulomb[j])
            number *= float(speed[j])
        elif self.fault == "quadratic_drag":
            size *= float(typical[j] / speed[j] ** 2)
        elif self.fault == "torque_saturation":
            size *= float(typical[j])
        elif self.fault == "heat from another joint":
            other = int(self.number)
            size = float(typical[other] * speed[other])
        return Fault(self.fault, j, size, number)

    def _bent(self, arm: Arm) -> Arm:
        """With the link before a joint as long as it truly is; its description and its loop know no
        better.
        """
        axes = list(arm.axes)
        for j, size in (
            (one.joint - 1, one.size) for one in self.faults if one.fault == "link_length"
        ):
            axes[j] = replace(axes[j], a=axes[j].a + size)
        return replace(arm, axes=tuple(axes))


def _scales(arm: Arm, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Typical torque and speed of each joint over a motion without friction, and the inertia that
    its drive feels at home.
    """
    t: Array = np.arange(0.0, 10.0, 0.02)
    model = arm.model(1e-3)
    data = mujoco.MjData(model)
    torque, path = [], motion("fourier", arm, t, rng)
    for q, dq, ddq in zip(*path, strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, dq, ddq
        mujoco.mj_inverse(model, data)
        torque.append(np.array(data.qfrc_inverse))
    data.qpos[:] = [axis.home for axis in arm.axes]
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    typical = np.std(torque, axis=0) + 0.3 * np.abs(np.mean(torque, axis=0))
    return typical, np.std(path[1], axis=0), 1.0 / np.diag(np.linalg.inv(mass))


def _friction(kind: str, typical: Array, speed: Array, rng: np.random.Generator) -> Friction:
    """Dry friction of 20 to 40 % of the typical torque, viscous of 15 to 35 % at the typical
    speed.
    """
    n = len(typical)
    coulomb = rng.uniform(0.2, 0.4, n) * typical
    viscous = rng.uniform(0.15, 0.35, n) * typical / speed
    width = (
        rng.uniform(0.01, 0.04, n) * speed
        if kind != "lugre"
        else rng.uniform(5e-4, 2e-3, n) * speed
    )
    return Friction(kind, coulomb, viscous, width, rng.uniform(0.08, 0.15, n) * speed)


DELAY = ("time_delay", "drive_lag")
SLOW = ("stribeck", "presliding", "three_sigmoid")
HEALTHY = (
    Case("pendulum", "tanh", "pd", 1e-3),
    Case("pendulum", "root", "cascade", 2e-3, motions=THREE),
    Case("lift", "tanh", "pid", 1e-3, motions=FIVE),
    Case("lift", "arctan", "cascade", 1e-3),
    Case("table", "root", "pid", 1e-3, motions=FIVE),
    Case("table", "tanh", "computed torque", 5e-4, coloured=True),
    Case("planar", "arctan", "pd", 2e-3),
    Case("planar", "tanh", "cascade", 4e-3, motions=FIVE, duration=15.0),
    Case("upright", "tanh", "pid", 4e-3),
    Case("upright", "root", "pd", 1e-3, motions=FIVE, coloured=True),
    Case("upright", "arctan", "pd+gravity", 1e-3, motions=THREE),
    Case("upright", "tanh", "cascade", 1e-3, resolution=2e-4, number_in_name=2),
    Case("scara", "tanh", "pid", 1e-3),
    Case("scara", "root", "cascade", 2e-3, motions=FIVE),
    Case("gantry", "tanh", "pd", 1e-3, motions=FIVE),
    Case("gantry", "arctan", "computed torque", 2e-3, coloured=True),
    Case("wrist", "tanh", "pd", 1e-3, resolution=1e-4),
    Case("wrist", "root", "pd+gravity", 1e-3),
    Case("six", "tanh", "pid", 1e-3),
    Case("six", "root", "cascade", 2e-3, duration=10.0),
    Case("upright", "stribeck", "pid", 1e-3, motions=FIVE, answers=SLOW),
    Case("upright", "lugre", "cascade", 1e-3, motions=FIVE, answers=SLOW),
    Case("planar", "lugre", "pd", 1e-3, answers=SLOW),
    Case("planar", "tanh", "pid", 1e-3, motions=(*BEFORE, *FOUR), number_in_name=2),
)
FAULTY = (
    Case("planar", "root", "pid", 1e-3, fault="torque_offset", joint=2, answers=("torque_offset",)),
    Case(
        "gantry",
        "tanh",
        "cascade",
        1e-3,
        fault="torque_offset",
        joint=1,
        answers=("torque_offset",),
    ),
    Case(
        "upright", "tanh", "pid", 1e-3, fault="cogging", joint=2, number=14.3, answers=("cogging",)
    ),
    Case(
        "gantry",
        "root",
        "pd",
        1e-3,
        motions=FIVE,
        fault="cogging",
        joint=2,
        number=2.0 * np.pi / 0.03,
        answers=("cogging",),
    ),
    Case("six", "tanh", "pid", 1e-3, fault="cogging", joint=3, number=22.0, answers=("cogging",)),
    Case("scara", "tanh", "pid", 2e-3, fault="spring", joint=1, answers=("spring",)),
    Case(
        "gantry",
        "arctan",
        "cascade",
        1e-3,
        fault="spring",
        joint=3,
        number=0.05,
        answers=("spring",),
    ),
    Case(
        "upright",
        "root",
        "pid",
        1e-3,
        fault="torque_gain",
        joint=2,
        size=0.1,
        answers=("torque_gain",),
    ),
    Case(
        "scara",
        "tanh",
        "pd+gravity",
        1e-3,
        fault="torque_gain",
        joint=2,
        size=0.15,
        answers=("torque_gain",),
    ),
    Case(
        "upright",
        "tanh",
        "pid",
        1e-3,
        duration=15.0,
        fault="viscous_drift",
        joint=1,
        size=-0.6,
        answers=("viscous_drift",),
    ),
    Case(
        "table",
        "arctan",
        "cascade",
        1e-3,
        duration=15.0,
        fault="viscous_drift",
        joint=1,
        size=0.8,
        answers=("viscous_drift",),
    ),
    Case(
        "upright",
        "arctan",
        "pd",
        1e-3,
        fault="asymmetric_friction",
        joint=3,
        size=0.3,
        answers=("asymmetric_friction",),
    ),
    Case(
        "lift",
        "tanh",
        "cascade",
        1e-3,
        motions=FIVE,
        fault="load_friction",
        joint=1,
        size=0.08,
        answers=("load_friction",),
    ),
    Case(
        "planar",
        "tanh",
        "pid",
        1e-3,
        motions=FIVE,
        fault="load_friction",
        joint=1,
        size=0.12,
        answers=("load_friction",),
    ),
    Case(
        "upright",
        "root",
        "cascade",
        1e-3,
        fault="gravity_tilt",
        size=0.09,
        number=0.8,
        answers=("gravity_tilt",),
    ),
    Case(
        "scara",
        "arctan",
        "pd",
        1e-3,
        fault="gravity_tilt",
        size=0.09,
        number=2.0,
        answers=("gravity_tilt",),
    ),
    Case("upright", "tanh", "pid", 1e-3, fault="torque_delay", size=4e-3, answers=DELAY),
    Case(
        "wrist",
        "tanh",
        "pd",
        1e-3,
        fault="torque_crosstalk",
        joint=2,
        size=0.15,
        number=0,
        answers=("torque_crosstalk",),
    ),
    Case(
        "upright",
        "root",
        "pid",
        1e-3,
        motions=(*BEFORE, *FOUR),
        fault="payload",
        size=0.6,
        answers=("payload",),
    ),
    Case(
        "six",
        "tanh",
        "pid",
        2e-3,
        motions=(*BEFORE, *FOUR),
        fault="payload",
        size=0.6,
        answers=("payload",),
    ),
    Case(
        "scara",
        "root",
        "pd",
        1e-3,
        motions=(*BEFORE, *FOUR),
        fault="cogging",
        joint=2,
        number=18.0,
        answers=("cogging",),
    ),
    Case("upright", "tanh", "pid", 1e-3, fault="heat from another joint", joint=3, number=1),
    Case("planar", "root", "cascade", 1e-3, fault="hopping torque", joint=1),
    Case("scara", "tanh", "pid", 1e-3, fault="hopping torque", joint=2),
)
CASES = (*HEALTHY, *FAULTY)
