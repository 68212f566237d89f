"""The small imperfections of a machine that is in order."""

from __future__ import annotations

import numpy as np

from bench.fault import Fault
from bench.faults.cogging import LINEAR, Cogging
from bench.machine import Machine
from bench.nuisances.coloured_noise import ColouredNoise
from bench.nuisances.gain_ripple import GainRipple
from bench.rigid import typical_torque

__all__ = ["nuisances_at"]

# Of the amplifier's noise: cogging, as at the RRR's elbow, and what a ripple of the gain makes of a slide's weight.
_COGGING, _RIPPLE = 0.2, 0.5


def nuisances_at(machine: Machine, joint: int, rng: np.random.Generator) -> tuple[Fault, ...]:
    """1 mN m of cogging, 0.1 % of gain ripple and coloured noise of half the amplifier's, at one joint (1-based).

    Cogging grows with the machine, but is nowhere more than the fifth of the amplifier's noise that it is at the RRR's elbow: at a
    wrist of a twentieth of the largest torque it would be no small imperfection. Along a slide orders are those of a linear motor,
    and as its weight is the same everywhere, a ripple of the gain is cogging there: of half the noise at most.
    """
    phase = rng.uniform(0.0, 2.0 * np.pi, 3).tolist()
    turning = machine.robot.joints[joint - 1].revolute
    orders = [float(order) * (1.0 if turning else LINEAR) for order in rng.integers(8, 37, 2)]
    noise = machine.amplifier_noise[joint - 1]
    cogging = min(1e-3 * max(machine.torque_limit) / 60.0, _COGGING * noise)
    weight = 0.0 if turning else typical_torque(machine.robot, acceleration=0.0)[joint - 1]
    ripple = min(1e-3, _RIPPLE * noise / weight) if weight else 1e-3
    return (Cogging(joint, orders[0], cogging, phase[0], phase[1]), GainRipple(joint, ripple, orders[1], phase[2]),
            ColouredNoise(joint, 0.5 * noise, float(rng.uniform(1.0, 5.0))))
