"""Simulated experiments of the RRR arm with Coulomb and viscous friction: the truth is known, and is in the model."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.body import Motion
from pipelines.effects.friction import Coulomb, Viscous
from pipelines.io.log import Array, Controller, ExperimentLog
from pipelines.simulation import Experiment, Noise, simulate
from sample_logs.make_closed_form import (
    NOISE,
    Fourier,
    averaged_torque,
    from_rest,
    quantised,
    recorded,
    torque_step,
    within_limits,
)
from sample_logs.make_model import synthetic_arm

COULOMB = (4.8, 2.4, 1.2)  # [N m]
VISCOUS = (0.6, 0.3, 0.12)  # [N m s/rad]


class Quick(Fourier):
    """The same motion ten times as fast: harmonics as powers of the first, right to 1e-14."""

    def __call__(self, t: Array) -> Motion:
        if len(t) > 4096:
            parts = [self(part) for part in np.array_split(t, -(-len(t) // 4096))]
            return Motion(t, *(np.concatenate([getattr(part, name) for part in parts]) for name in ("q", "dq", "ddq")))
        w = 2 * math.pi * self.df * np.arange(1, self.a.shape[1] + 1)
        turn = np.exp(2j * math.pi * self.df * t)
        powers = np.cumprod(np.broadcast_to(turn[:, None], (len(t), len(w))), axis=1)
        s, c = np.ascontiguousarray(powers.imag), np.ascontiguousarray(powers.real)
        return Motion(t, self.q0 + s @ (self.a / w).T - c @ (self.b / w).T, c @ self.a.T + s @ self.b.T,
                      -s @ (self.a * w).T + c @ (self.b * w).T)


@lru_cache
def arm() -> Arm:
    """The arm of the sample logs; p4 = p15 = 0, for its links are symmetric."""
    laws = [Acting.of(Coulomb(j), {"level": level, "sharpness": 100.0}, origin="known") for j, level in enumerate(COULOMB, 1)]
    laws += [Acting.of(Viscous(j), {"coefficient": value}, origin="known") for j, value in enumerate(VISCOUS, 1)]
    return replace(synthetic_arm(), friction=tuple(laws))


def motion_of(seed: int, moving: Array | None = None) -> Fourier:
    rng = np.random.default_rng([3, seed])
    drawn = from_rest(rng, np.array([0.0, -math.pi / 2, 1.0]), 0.1, np.ones(3) if moving is None else moving)
    return within_limits(Quick(drawn.q0, drawn.a, drawn.b, drawn.df), arm())


def experiment(seed: int, role: str = "identify", moving: Array | None = None, duration: float = 10.0) -> ExperimentLog:
    """10 s at 1 kHz: encoders of 1e-5 rad, torque noise of 20, 10, 5 mN m, torque averaged over each sample."""
    return _experiment(seed, role, None if moving is None else tuple(moving.tolist()), duration)


@lru_cache(maxsize=16)
def _experiment(seed: int, role: str, moving: tuple[float, ...] | None, duration: float) -> ExperimentLog:
    motion = motion_of(seed, None if moving is None else np.array(moving))
    return recorded(arm(), motion, duration, np.random.default_rng([4, seed]), name=f"excitation-{seed}",
                    experiment="excitation", role=role, period=10.0)


@lru_cache(maxsize=8)
def one_period(seed: int) -> tuple[Array, Array]:
    """Position and torque of 10 s at 1 kHz, without noise, from a moment in which no joint rests."""
    motion, t = motion_of(seed), np.arange(10_000, dtype=np.float64) * 1e-3
    return np.roll(motion(t).q, 3000, axis=0), np.roll(averaged_torque(arm(), motion, t), 3000, axis=0)


def periodic(seed: int, periods: int, encoder: float = 3e-6, role: str = "identify",
             spoil: Callable[[Array, Array], None] | None = None) -> ExperimentLog:
    """So many periods of 10 s, with noise on the position [rad] and the amplifier's on the torque.

    Args:
        spoil: changes position and torque in place, before noise and counting.
    """
    rng, log = np.random.default_rng([9, seed]), experiment(seed, role)
    q, tau = (np.tile(x, (periods, 1)) for x in one_period(seed))
    if spoil is not None:
        spoil(q, tau)
    values = {"t": np.arange(len(q), dtype=np.float64) * 1e-3, "q": quantised(q + encoder * rng.standard_normal(q.shape), 1e-5),
              "tau": quantised(tau + NOISE * rng.standard_normal(q.shape), torque_step(log.robot))}
    return replace(log, signals={name: replace(log.signals[name], values=x) for name, x in values.items()}, name=f"periodic-{seed}")


@lru_cache(maxsize=8)
def looped(seed: int, periods: int, role: str = "identify", loop_hz: float = 8.0) -> ExperimentLog:
    """The same motion under PD control without feed-forward, from rest: the arm sags some hundredths of a radian at first."""
    log, t = experiment(seed, role), np.arange(10_000 * periods, dtype=np.float64) * 1e-3
    motion, omega = motion_of(seed)(t), 2.0 * math.pi * loop_hz
    inertia = np.diag(arm().body.mass_matrix(motion.q[:1], arm().p)[0])
    law = Controller("pd", kp=inertia * omega**2, kd=2.0 * inertia * omega, velocity="backward-difference", delay=0,
                     output_limit=np.array([joint.torque for joint in log.robot.joints]))
    asked = Experiment(1e-3, 0.0, law, motion.q, motion.dq, motion.ddq, motion.q[0], motion.dq[0], np.zeros(3), np.full(3, 1e-5))
    done = simulate(arm(), asked, Noise(NOISE, np.zeros(3)), (seed,))
    values = {"t": t, "q": done.q[0], "tau": done.tau[0]}
    return replace(log, signals={name: replace(log.signals[name], values=x) for name, x in values.items()}, name=f"{role}-{seed}")


def truth(names: list[str]) -> Array:
    """The parameters of those names; a drive without an offset has the offset zero."""
    known = arm().parameters
    return np.array([known[name].value if name in known else 0.0 for name in names])
