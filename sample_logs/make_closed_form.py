"""The logs of rrr-closed-form/: the RRR arm of models/rrr.json moved along prescribed motions.

There is no controller: the torque is that of inverse dynamics. Every run gives the same logs,
digest by digest, and the quantisation keeps it so on machines whose sine differs in the last bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bench.config import CONFIG, SAMPLE_TIME
from pipelines.dynamics.arm import Arm
from pipelines.dynamics.body import Motion
from pipelines.io import schema
from pipelines.io.log import Array, ExperimentLog, Signal
from pipelines.io.robot import RobotDescription, format_robot
from sample_logs.make_model import synthetic_arm

NOISE = np.array([0.020, 0.010, 0.005])  # [N m] rms, white, of the amplifier
Movement = Callable[[Array], Motion]


@dataclass(frozen=True)
class Fourier:
    """A periodic motion. Kostić et al. 2004, eq. (22), w_j = 2 pi j df:

    q = q0 + sum_j (a_j sin w_j t - b_j cos w_j t)/w_j
    """

    q0: Array  # [rad] (joints,)
    a: Array  # [rad/s] (joints, harmonics)
    b: Array  # [rad/s] (joints, harmonics)
    df: float  # [Hz]

    def __call__(self, t: Array) -> Motion:
        w = 2 * math.pi * self.df * np.arange(1, self.a.shape[1] + 1)
        s, c = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
        return Motion(
            t,
            self.q0 + s @ (self.a / w).T - c @ (self.b / w).T,
            c @ self.a.T + s @ self.b.T,
            -s @ (self.a * w).T + c @ (self.b * w).T,
        )


def from_rest(
    rng: np.random.Generator,
    q0: Array,
    df: float,
    moving: Array,
    corner_hz: float = CONFIG.corner_hz,
    harmonics: int = 60,
) -> Fourier:
    """Draw coefficients with sum a = 0 and sum j b = 0, from neither speed nor acceleration."""
    j = np.arange(1, harmonics + 1)
    spectrum = 1 / (1 + (j * df / corner_hz) ** 2)
    a, b = rng.normal(size=(2, len(q0), harmonics)) * spectrum
    # The least change, measured in units of the spectrum, that meets each condition.
    a -= np.outer(a.sum(axis=1) / np.sum(spectrum**2), spectrum**2)
    b -= np.outer(b @ j / np.sum((j * spectrum) ** 2), j * spectrum**2)
    return Fourier(q0, a * moving[:, None], b * moving[:, None], df)


def within_limits(motion: Fourier, arm: Arm, part: float = 0.85, speed: float = 1.0) -> Fourier:
    """Scale a motion joint by joint to `part` of its limits of speed and acceleration, then by
    torque.

    `speed` is a further part of the speed limit, for slow motions.
    """
    joints = arm.robot.joints
    t: Array = np.arange(0.0, 1 / motion.df, 5e-3)
    now = motion(t)
    allowed = np.minimum(
        [speed * joint.velocity for joint in joints] / (np.abs(now.dq).max(axis=0) + 1e-9),
        [joint.acceleration for joint in joints] / (np.abs(now.ddq).max(axis=0) + 1e-9),
    )
    scaled = replace(
        motion, a=motion.a * (part * allowed)[:, None], b=motion.b * (part * allowed)[:, None]
    )
    limit = part * np.array([joint.torque for joint in joints])
    while (np.abs(arm.torque(scaled(t))) > limit).any():
        scaled = replace(scaled, a=0.95 * scaled.a, b=0.95 * scaled.b)
    return scaled


def averaged_torque(arm: Arm, motion: Movement, t: Array) -> Array:
    """Return the mean torque (samples, n) [N m] over [t_k, t_k + T), as a drive holds each command.

    Gauss-Legendre on the two halves of each interval, 6 points each: friction turns over within one
    sample where the joint reverses quickly.
    """
    nodes, weights = np.polynomial.legendre.leggauss(6)
    fractions = np.concatenate([0.25 * (nodes + 1), 0.25 * (nodes + 3)])
    at = (t[:, None] + SAMPLE_TIME * fractions).ravel()
    torque = arm.torque(motion(at)).reshape(len(t), len(fractions), -1)
    return np.asarray(np.einsum("sfj,f->sj", torque, np.concatenate([weights, weights]) / 4))


def quantised(values: Array, step: Array | float) -> Array:
    """Round to whole steps."""
    return np.asarray(np.round(values / step) * step)


def torque_step(robot: RobotDescription) -> Array:
    """Return one bit of the torque command (n,) [N m]."""
    return np.array([2 * joint.torque / 2**CONFIG.command_bits for joint in robot.joints])


def recorded(
    arm: Arm, motion: Movement, duration: float, rng: np.random.Generator, **about: Any
) -> ExperimentLog:
    """Return the log as encoders and drive would have written it down."""
    robot = arm.robot
    t: Array = np.arange(round(duration / SAMPLE_TIME), dtype=np.float64) * SAMPLE_TIME
    resolution = np.array([joint.encoder_resolution for joint in robot.joints], dtype=np.float64)
    tau = averaged_torque(arm, motion, t)
    values = {
        "t": t,
        "q": quantised(motion(t).q, resolution),
        "tau": quantised(tau + NOISE * rng.normal(size=tau.shape), torque_step(robot)),
    }
    signals = {
        name: Signal(array, schema.unit_of(name), schema.SIGNALS[name][1])
        for name, array in values.items()
    }
    return ExperimentLog(
        origin="simulated",
        robot_name=robot.name,
        sample_time=SAMPLE_TIME,
        robot_text=format_robot(robot),
        signals=signals,
        **about,
    )


def closed_form_logs() -> dict[str, ExperimentLog]:
    """Return every log of `rrr-closed-form/` by the name of its file."""
    arm = synthetic_arm()
    logs = [
        excitation(arm, 1, "identify"),
        excitation(arm, 2, "validate"),
        slow(arm),
        hold(arm),
        *(one_joint(arm, joint) for joint in (1, 2, 3)),
    ]
    return {f"{log.name}.h5": log for log in logs}


def excitation(arm: Arm, number: int, role: str) -> ExperimentLog:
    """Move all joints for one period of 10 s, from rest."""
    rng = np.random.default_rng([22, number])
    # Hanging, or gravity takes the torque that the motion needs.
    q0 = np.array([0.0, -math.pi / 2, 1.0])
    motion = within_limits(from_rest(rng, q0, 0.1, np.ones(3)), arm)
    about = {"name": f"excitation-{number}", "experiment": "excitation", "role": role}
    return recorded(arm, motion, 10.0, rng, **about, period=10.0)


def slow(arm: Arm) -> ExperimentLog:
    """Move all joints slowly through many postures: gravity and friction at low speed."""
    rng = np.random.default_rng([22, 3])
    q0 = np.array([0.0, 0.5, -0.5])
    sweep = from_rest(rng, q0, 1 / 15, np.ones(3), corner_hz=0.15, harmonics=12)
    motion = within_limits(sweep, arm, speed=0.12)
    about = {"name": "free-1", "experiment": "free", "role": "identify"}
    return recorded(arm, motion, 15.0, rng, **about)


def hold(arm: Arm) -> ExperimentLog:
    """Rest: gravity, and what a torque sensor would call its offset."""
    rng = np.random.default_rng([22, 4])
    posture = np.array([0.4, 0.6, -1.1])
    still = Fourier(posture, np.zeros((3, 1)), np.zeros((3, 1)), 1.0)
    about = {"name": "hold-1", "experiment": "hold", "role": "identify"}
    return recorded(arm, still, 3.0, rng, **about, posture=posture)


def one_joint(arm: Arm, joint: int) -> ExperimentLog:
    """Move one joint (1-based) through all its speeds with reversals, the elbow stretched."""
    rng = np.random.default_rng([22, 4 + joint])
    moving = np.arange(1, 4) == joint
    q0 = np.array([0.0, -math.pi / 2, 0.0])
    sway = from_rest(rng, q0, 0.1, moving.astype(np.float64), harmonics=30)
    about = {"name": f"friction-{joint}", "experiment": "friction", "role": "identify"}
    return recorded(arm, within_limits(sway, arm), 10.0, rng, **about, joint=joint, period=10.0)
