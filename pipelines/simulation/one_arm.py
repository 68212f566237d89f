"""One RRR arm and its controller in plain numbers: for a single robot arrays cost ten times more.

    if OneArm.fits(plant):
        motion, counted, commanded = run_alone(plant, experiment, steps, start, draws)

Functions of effects are the same that arrays are handed to; the controller is the same law, joint
by joint. The integrator is that of `integrate`, Kutta 1901.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from math import nan, tanh

import numpy as np

from pipelines.dynamics.functions import NUMBERS
from pipelines.dynamics.rrr import RRR
from pipelines.effects.base import Hooks, SpeedCurve
from pipelines.errors import InputRejected
from pipelines.io.log import Array
from pipelines.simulation.bodies import acceleration_of
from pipelines.simulation.config import SIMULATION
from pipelines.simulation.controller import Feedback, ahead_of
from pipelines.simulation.experiment import Experiment
from pipelines.simulation.plant import Plant

__all__ = ["OneArm", "refuse_runaway", "run_alone", "runs_alone"]

_AT_ONCE = 2048  # numerics: samples that are Python numbers at once; all take ten times the room
_LOOKS = 64  # numerics: samples between two looks at whether the arm runs away

Numbers = list[float]
Slope = Callable[..., tuple[float, float, float, Numbers]]


class OneArm:
    """The integrator of one arm that no array is needed for, used as `RungeKutta` is."""

    def __init__(self, plant: Plant, sample_time: float, steps: int) -> None:
        """Take a `plant` as it `fits`; `steps` of equal size make one control sample."""
        self.slope, self.steps, self.h = _slope_of(plant), steps, sample_time / steps

    @staticmethod
    def fits(plant: Plant) -> bool:
        """Return whether nothing moves it but what is known in plain numbers."""
        return isinstance(plant.body, RRR) and all(_in_numbers(hook) for hook in plant.hooks)

    def moved(self, x: Numbers, torque: Numbers) -> Numbers:
        """Return the state after one control sample, not numbers where the arm ran away."""
        try:
            for _ in range(self.steps):
                x = self._step(x, torque)
        except (ValueError, OverflowError):  # of an infinite number there is no sine
            return [nan] * len(x)
        return x

    def _step(self, x: Numbers, torque: Numbers) -> Numbers:
        """Return the state after a step: stages k, m, n, o of dq/dt, dv/dt and memories db/dt.

        Written out for three joints, which takes half the time of loops over them.
        """
        q1, q2, q3, v1, v2, v3, *b = x
        slope, h, half, sixth = self.slope, self.h, 0.5 * self.h, self.h / 6.0
        k1, k2, k3, kb = slope(q1, q2, q3, v1, v2, v3, b, torque)
        w1, w2, w3 = v1 + half * k1, v2 + half * k2, v3 + half * k3
        here = [a + half * rate for a, rate in zip(b, kb, strict=True)] if b else b
        m1, m2, m3, mb = slope(q1 + half * v1, q2 + half * v2, q3 + half * v3, w1, w2, w3, here,
                               torque)
        y1, y2, y3 = v1 + half * m1, v2 + half * m2, v3 + half * m3
        here = [a + half * rate for a, rate in zip(b, mb, strict=True)] if b else b
        n1, n2, n3, nb = slope(q1 + half * w1, q2 + half * w2, q3 + half * w3, y1, y2, y3, here,
                               torque)
        z1, z2, z3 = v1 + h * n1, v2 + h * n2, v3 + h * n3
        here = [a + h * rate for a, rate in zip(b, nb, strict=True)] if b else b
        o1, o2, o3, ob = slope(q1 + h * y1, q2 + h * y2, q3 + h * y3, z1, z2, z3, here, torque)
        bent = zip(b, kb, mb, nb, ob, strict=True)
        return [
            q1 + sixth * (v1 + 2.0 * (w1 + y1) + z1), q2 + sixth * (v2 + 2.0 * (w2 + y2) + z2),
            q3 + sixth * (v3 + 2.0 * (w3 + y3) + z3), v1 + sixth * (k1 + 2.0 * (m1 + n1) + o1),
            v2 + sixth * (k2 + 2.0 * (m2 + n2) + o2), v3 + sixth * (k3 + 2.0 * (m3 + n3) + o3),
            *[a + sixth * (k + 2.0 * (m + n) + o) for a, k, m, n, o in bent]
        ]

    def advance(self, t: Array, state: Array, states: Array, command: Array) -> Array:
        """Move `state` (6, 1) on by one sample, in place, and return the memories' new states."""
        del t
        now = self.moved([*state[:, 0].tolist(), *states[0].tolist()], command[:, 0].tolist())
        state[:, 0] = now[:6]
        return np.array([now[6:]])


def _in_numbers(hook: Hooks) -> bool:
    if hook.actuator or hook.sensor or hook.load or hook.rate or hook.update or hook.settled:
        return False
    return not hook.states or hook.remembering is not None


def _slope_of(plant: Plant) -> Slope:
    """Return q, dq, memories, command -> ddq and the memories' rates, joint by joint."""
    assert isinstance(plant.body, RRR)
    acceleration = acceleration_of(plant.body, plant.p, plant.added)
    first, second, third = (_curve(curve) for curve in plant.curves)
    hooks = plant.hooks
    drives = [hook.drive for hook in reversed(hooks) if hook.drive is not None]
    loads = [hook.alone for hook in hooks if hook.alone is not None]
    memories = [hook.remembering for hook in hooks if hook.remembering is not None]

    def slope(  # noqa: PLR0913
            q1: float, q2: float, q3: float, v1: float, v2: float, v3: float, bent: Numbers,
            command: Numbers) -> tuple[float, float, float, Numbers]:
        rates = bent
        if hooks:
            q, v, command, rates = (q1, q2, q3), (v1, v2, v3), command.copy(), []
            for joint, drive in drives:
                command[joint] = drive(command, v, NUMBERS)
            for joint, load in loads:
                command[joint] -= load(q[joint], v[joint], NUMBERS)
            for b, (joint, memory) in zip(bent, memories, strict=True):
                rates.append(memory.rate(b, v[joint], NUMBERS))
                command[joint] -= memory.load(b, rates[-1])
        u1, u2, u3 = command
        u1, u2, u3 = u1 - first(v1), u2 - second(v2), u3 - third(v3)
        a1, a2, a3 = acceleration(q2, q3, v1, v2, v3, u1, u2, u3)
        return a1, a2, a3, rates

    return slope


def _curve(form: SpeedCurve) -> Callable[[float], float]:
    """τ(v) = constant + viscous v + Σ height tanh(sharpness v), most often of one or three."""
    constant, viscous = form.constant, form.viscous
    pairs = list(zip(form.heights, form.sharpnesses, strict=True))
    if len(pairs) == 1:
        ((f, w),) = pairs
        return lambda v: constant + viscous * v + f * tanh(w * v)
    if len(pairs) == 3:  # noqa: PLR2004
        (f1, w1), (f2, w2), (f3, w3) = pairs
        return lambda v: (constant + viscous * v + f1 * tanh(w1 * v) + f2 * tanh(w2 * v) + f3 *
                          tanh(w3 * v))
    return lambda v: form.of(v, NUMBERS)


def runs_alone(plant: Plant, experiment: Experiment) -> bool:
    """Return whether plain numbers are enough: torque hangs on reference and error alone."""
    law = experiment.controller.law in ("pd", "pd+feedforward") and experiment.driven is None
    alike = experiment.v is None or experiment.v.ndim == experiment.q_ref.ndim
    return law and alike and OneArm.fits(plant)


def run_alone(plant: Plant, experiment: Experiment, steps: int, start: Array,
              draws: Iterable[tuple[Array | float, Array | float]],
              ) -> tuple[Array, Array, Array]:
    """Return motion (samples, 2 joints), counted angles and commands (samples, joints).

    Args:
        start: (2 joints and memories,) at the first sample.
        draws: noise of drives and encoders of each sample, (joints, 1), or zero.

    Raises:
        InputRejected: D17, the arm runs away.
    """
    arm = OneArm(plant, experiment.sample_time, steps)
    laws = [Feedback(experiment, joint) for joint in range(experiment.n_joints)]
    x: Numbers = start.tolist()
    n = experiment.n_samples
    motion, counted, commanded = (np.empty((n, width)) for width in (6, 3, 3))
    rows = zip(_listed(experiment.q_ref), _listed(ahead_of(experiment)), draws, strict=True)
    for k, (reference, ahead, (torque, position)) in enumerate(rows):
        angles, applied = x[:3], torque
        if not isinstance(position, float):
            angles = [a + b for a, b in zip(angles, position[:, 0].tolist(), strict=True)]
        motion[k] = x[:6]
        seen, said = [], []
        try:
            for law, angle, wanted, more in zip(laws, angles, reference, ahead, strict=True):
                q = angle if law.counts is None else law.counts(angle)
                seen.append(q)
                said.append(law.delayed(law.limited(law(q - wanted, more))))
        except (ValueError, OverflowError):  # of an infinite number there is no count
            x = [nan] * len(x)
        if k % _LOOKS == 0 or x[0] != x[0]:
            refuse_runaway(np.array(x[:6])[:, None], k, experiment.sample_time)
        counted[k], commanded[k] = seen, said
        if not isinstance(applied, float):
            said = [a + b for a, b in zip(said, applied[:, 0].tolist(), strict=True)]
        x = arm.moved(x, said)
    refuse_runaway(np.array(x[:6])[:, None], n, experiment.sample_time)
    return motion, counted, commanded


def _listed(x: Array) -> Iterator[Numbers]:
    """Yield the rows of `x` as lists."""
    for first in range(0, len(x), _AT_ONCE):
        yield from x[first:first + _AT_ONCE].tolist()


def refuse_runaway(state: Array, k: int, sample_time: float) -> None:
    """Refuse a state (2 joints, replicas) that no arm is ever in.

    Raises:
        InputRejected: D17, the simulated arm runs away.
    """
    here = np.abs(state) <= SIMULATION.runaway  # what is not a number is no motion either
    if not here.all():
        joint = int(np.argmax(~here.all(axis=1))) % (len(state) // 2) + 1
        raise InputRejected(
            "D17", f"the simulated arm runs away: joint {joint}, after {k * sample_time:.3g} s",
            remedy="check the model's inertia and friction, and the gains that the log gives",
        )
