"""Ways to spoil a good log, one fault at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from pipelines.io.log import Array, ExperimentLog
from tests import healthy
from tests.healthy import arm_torque, fourier, make_log, rows, with_signal


def retimed(log: ExperimentLog, change: Callable[[Array], Array]) -> ExperimentLog:
    return with_signal(log, t=change(log.t.copy()))


def dropped(log: ExperimentLog, keep: Callable[[Array], Array]) -> ExperimentLog:
    return rows(log, keep(np.arange(log.n_samples)))


def repeated(log: ExperimentLog, k: int = 3000) -> ExperimentLog:
    return rows(log, np.insert(np.arange(log.n_samples), k + 1, k))


def spiky(log: ExperimentLog, signal: str, joint: int, size: float) -> ExperimentLog:
    rng = np.random.default_rng(0)
    values = log[signal].copy()
    at = rng.choice(np.arange(50, log.n_samples - 50), 12, replace=False)
    values[at, joint] += size * rng.choice([-1, 1], 12)
    return with_signal(log, **{signal: values})


def wrapped(log: ExperimentLog) -> ExperimentLog:
    del log
    spinning = turning(1.5, 0)
    free = make_log(spinning, "free")
    return with_signal(free, q=np.column_stack([(free.q[:, 0] + np.pi) % (2 * np.pi) - np.pi, free.q[:, 1:]]))


def turning(speed: float, joint: int) -> healthy.Path:
    """An excitation on top of a constant speed of one joint."""
    path = fourier(np.random.default_rng(7), level=0.3)

    def turn(t: Array) -> tuple[Array, Array, Array]:
        q, dq, ddq = path(t)
        only = np.arange(3) == joint
        return q + np.outer(speed * t, only), dq + speed * only, ddq

    return turn


def shifted(log: ExperimentLog, by: float) -> ExperimentLog:
    late = (np.arange(log.n_samples) > 2500)[:, None] & (np.arange(3) == 1)
    return with_signal(log, q=log.q - by * late)


def stopped(log: ExperimentLog) -> ExperimentLog:
    q, tau = log.q.copy(), log.tau.copy()
    q[4000:], tau[4000:] = q[4000], 0.0
    return with_signal(log, q=q, tau=tau)


def runaway(log: ExperimentLog) -> ExperimentLog:
    """From sample 4500 on, joint 3 falls away from its reference."""
    late = np.maximum(0.0, log.t - log.t[4500])
    return with_signal(log, q=log.q - np.outer(5.0 * late**2, [0, 0, 1]))


def drifting(log: ExperimentLog, samples: float) -> ExperimentLog:
    """The torque's clock runs faster: `samples` apart at the end."""
    k = np.arange(log.n_samples)
    return with_signal(log, tau=np.stack([np.interp(k * (1 + samples / log.n_samples), k, c) for c in log.tau.T], axis=-1))


def clipped(path: healthy.Path, t: Array) -> Array:
    return np.clip(1.6 * arm_torque(path, t), -healthy.LIMIT, healthy.LIMIT)


@lru_cache
def good_path() -> healthy.Path:
    return fourier(np.random.default_rng(1000))


def faster(factor: float) -> healthy.Path:
    """The good log's motion, `factor` times as fast."""
    def path(t: Array) -> tuple[Array, Array, Array]:
        q, dq, ddq = good_path()(factor * t)
        return q, factor * dq, factor**2 * ddq

    return path


def healthy_without_reference(log: ExperimentLog) -> ExperimentLog:
    return replace(log, signals={k: s for k, s in log.signals.items() if "ref" not in k})
