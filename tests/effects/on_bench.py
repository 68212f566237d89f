"""Short logs of a noiseless machine of the virtual test bench, one fault at a time, and the arm that a perfect fit would find."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from bench.config import SAMPLE_TIME
from bench.draw import draw_machine
from bench.experiments import Experiment as Planned
from bench.experiments import excitation
from bench.faults import make
from bench.machine import Fault, Machine
from bench.plant import Recording, run
from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.body import Motion
from pipelines.effects import find_effect
from pipelines.effects.base import Effect
from pipelines.effects.friction import Coulomb, Viscous
from pipelines.io.log import Array

__all__ = ["DURATION", "arm", "effect_of", "fault", "faulty", "left_over", "machine", "motion_and_torque", "planned", "rms"]

DURATION = 2.0  # [s]
_SETTLED = 80  # samples until the drives have caught what hangs on them
_TURNING = 8  # samples to either side of a reversal in which dry friction is no smooth signal


@lru_cache
def machine() -> Machine:
    return draw_machine(3, "fault", nuisances=False).ideal


@lru_cache
def arm() -> Arm:
    """The machine's own links and friction."""
    rigid, laws = Arm.from_links(machine().robot), []
    for joint, law in enumerate(machine().friction, start=1):
        assert len(law.heights) == 1
        laws += [Acting.of(Coulomb(joint), {"level": law.coulomb, "sharpness": law.sharpness}),
                 Acting.of(Viscous(joint), {"coefficient": law.viscous})]
    return replace(rigid, friction=tuple(laws))


@lru_cache
def planned() -> Planned:
    return excitation(machine(), 1, period=DURATION, periods=1)


@lru_cache
def healthy() -> Recording:
    return run(machine(), planned().law, planned().reference)


@lru_cache
def fault(name: str, joint: int | None) -> Fault:
    """At full strength; what drifts does so within the log, and a touch comes early."""
    peak = tuple(np.abs(healthy().tau).max(axis=0).tolist())
    made = make(name, machine(), joint, seed=5, peak_torque=peak, duration=DURATION)
    sooner: dict[str, dict[str, Any]] = {"viscous_drift": {"time_constant": 0.7, "relative_change": 1.5},
                                         "contact": {"start_time": 0.15, "duration": 0.2}}
    return replace(made, **sooner.get(name, {}))


@lru_cache
def faulty(name: str, joint: int | None) -> Recording:
    return run(machine(), planned().law, planned().reference, (fault(name, joint),))


def effect_of(name: str, joint: int | None) -> tuple[Effect, dict[str, float]]:
    """The effect of the fault's name with the parameters of its sealed answer, and what further numbers they go with."""
    at_hand = fault(name, joint)
    told: dict[str, Any] = dict(at_hand.parameters())
    told |= {f"first_moment_{axis}": x for axis, x in zip("xyz", told.pop("first_moment", ()), strict=False)}
    if name == "contact":
        told |= {f"force_{axis}": told["force"] * x for axis, x in zip("xyz", at_hand.direction, strict=True)}  # type: ignore[attr-defined]
    told |= {key: getattr(at_hand, key) for key in ("sharpness",) if hasattr(at_hand, key)}
    told |= {"coefficient": 1.0} if name == "torque_saturation" else {}
    kind = find_effect(name)
    effect = kind(joint) if kind.scope == "joint" else kind()
    values = {q.name: float(told.get(q.name, getattr(effect, q.name) if q.shape else 0.0)) for q in effect.parameters}
    return effect.at(values), values


def motion_and_torque(recording: Recording) -> tuple[Motion, Array]:
    """The true motion, and the torque averaged from one sample before to one behind, as the logged commands say.

    The change of speed over the same time is the average acceleration, whatever the torque does between.
    """
    q, dq, inner = recording.true_q, recording.true_dq, slice(1, -1)
    ddq = (dq[2:] - dq[:-2]) / (2.0 * SAMPLE_TIME)
    motion = Motion(recording.t[inner], q[inner], dq[inner], ddq, recording.tau[inner])
    return motion, 0.5 * (recording.tau[1:-1] + recording.tau[:-2])


def left_over(recording: Recording, torque: Array) -> Array:
    """Logged less predicted torque (samples, joints), where the start is over and no joint turns round."""
    motion, tau = motion_and_torque(recording)
    turns = np.any(np.diff(np.sign(motion.dq), axis=0) != 0.0, axis=1)
    near = np.convolve(turns, np.ones(2 * _TURNING), mode="full")[_TURNING - 1:_TURNING + len(tau) - 1] > 0.0
    near[:_SETTLED] = True
    return np.asarray((tau - torque)[~near])


def rms(x: Array) -> float:
    return float(np.sqrt(np.mean(np.square(x))))
