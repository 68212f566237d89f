"""The small imperfections of a machine that is in order."""

from __future__ import annotations

import numpy as np

from pipelines.bench.fault import Fault
from pipelines.bench.faults.cogging import Cogging
from pipelines.bench.machine import Machine
from pipelines.bench.nuisances.coloured_noise import ColouredNoise
from pipelines.bench.nuisances.gain_ripple import GainRipple

__all__ = ["nuisances_at"]


def nuisances_at(machine: Machine, joint: int, rng: np.random.Generator) -> tuple[Fault, ...]:
    """1 mN m of cogging, 0.1 % of gain ripple and coloured noise of half the amplifier's, at one joint (1-based)."""
    phase = rng.uniform(0.0, 2.0 * np.pi, 3).tolist()
    orders = [float(order) for order in rng.integers(8, 37, 2)]
    return (Cogging(joint, orders[0], 1e-3 * max(machine.torque_limit) / 60.0, phase[0], phase[1]),
            GainRipple(joint, 1e-3, orders[1], phase[2]),
            ColouredNoise(joint, 0.5 * machine.amplifier_noise[joint - 1], float(rng.uniform(1.0, 5.0))))
