"""One RRR arm under one of the laws (23), (24) of Kostić et al. 2004, sample by sample, without arrays.

    if OneLoop.fits(plant, experiment):
        motion, counted, commanded = OneLoop(plant, experiment, steps, exact).run(start, noise, watch)

What `Controlling` and `OneRRR`, or `OneHeld`, do, in one loop that is written out as Python text and compiled for each experiment:
for a single robot, small arrays cost more than the arithmetic of its controller and half as much as that of its dynamics.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from itertools import chain, islice, repeat
from math import nan
from types import CodeType
from typing import Any

import numpy as np

from pipelines.model.rigid.body import Array
from pipelines.model.simulation.control import feedforward_of
from pipelines.model.simulation.experiment import Experiment
from pipelines.model.simulation.one_held import HELD, OneHeld
from pipelines.model.simulation.one_rrr import OneRRR
from pipelines.model.simulation.plant import Plant

__all__ = ["OneLoop"]

_JOINTS = (1, 2, 3)
_PART = 64  # samples between two looks at whether the arm runs away
_AT_ONCE = 2048  # samples that are Python numbers at once

_LOOP = """
def loop(now, memory, rows, record, step, round=round, min=min, max=max):
    q1, q2, q3, v1, v2, v3{bent} = now
    {memory} = memory
    for (r1, r2, r3), (f1, f2, f3), (n1, n2, n3, o1, o2, o3) in rows:
{law}
        record((q1, q2, q3, v1, v2, v3, s1, s2, s3, c1, c2, c3))
{steps}
    return (q1, q2, q3, v1, v2, v3{bent}), ({memory})
"""
_STEP = "        q1, q2, q3, v1, v2, v3{bent} = step(q1, q2, q3, v1, v2, v3{bent}, c1 + n1, c2 + n2, c3 + n3)"

# x̂ = E x̂, then x̂ + k (e - c x̂): (16), (20); a, b, d: estimate of the error, its speed and acceleration.
_OBSERVED = ("p = a{j} + {h} * b{j} + {h2} * d{j}", "b{j} += {h} * d{j}", "x = e{j} - p", "a{j} = p + {k1} * x", "b{j} += {k2} * x",
             "d{j} += {k3} * x")
_DIFFERENCE = ("a{j}, b{j} = e{j}, 0.0 if d{j} is None else (e{j} - d{j}) * {rate}", "d{j} = e{j}")

_Now = tuple[float, ...]


class OneLoop:
    """One arm and its controller."""

    def __init__(self, plant: Plant, experiment: Experiment, steps: int, exact: bool) -> None:
        """`plant` and `experiment` as they fit it; `steps` of equal size make one control sample; `exact`: with a rigid body that
        is nowhere held."""
        self._experiment = experiment
        self._integrator = (OneRRR if exact else OneHeld)(plant, experiment.sample_time, steps)
        scope: dict[str, Any] = {}
        exec(_code(_text(experiment, steps, len(plant.own_memories) + (0 if exact else len(HELD)))), scope)
        self._loop: Callable[..., tuple[_Now, tuple[Any, ...]]] = scope["loop"]

    @staticmethod
    def fits(plant: Plant, experiment: Experiment) -> bool:
        """Return whether encoders see the angles as they are, and the torque hangs on nothing but reference and error."""
        law = experiment.controller.law in ("pd", "pd+feedforward") and experiment.driven is None
        each = experiment.v is None or experiment.v.ndim == 2
        return law and each and OneRRR.fits(plant) and not any(hook.sensor for hook in plant.hooks)

    def run(self, start: Array, noise: Iterator[Array] | None, watch: Callable[[Array, int], None]) -> tuple[Array, Array, Array]:
        """What it does from `start` (2 joints and memories,) on: motion (samples, 2 joints), counted angles and commands
        (samples, joints).

        Args:
            noise: (samples, 2 joints) of drives, then of encoders, in pieces of any length; None: there is none.
            watch: is shown every now and then where the arm is, (2 joints,), after how many samples; it has to raise where that
                are no numbers, for there the arithmetic has given up.
        """
        experiment = self._experiment
        table = np.empty((experiment.n_samples, 12))
        now, memory = tuple(start.tolist()), self._memory()
        if isinstance(self._integrator, OneHeld):
            now = (*now, *self._integrator.held(now))
        drawn = repeat((0.0,) * 6) if noise is None else chain.from_iterable(map(np.ndarray.tolist, noise))
        rows = zip(_listed(experiment.q_ref), _fed(experiment), drawn, strict=False)
        for first in range(0, len(table), _PART):
            part: list[_Now] = []
            try:
                now, memory = self._loop(now, memory, islice(rows, _PART), part.append, self._integrator.step)
            except (ValueError, OverflowError):  # of an infinite number there is neither a sine nor a count
                now = (nan,) * len(now)
            watch(np.array(now[:6]), first + len(part))
            table[first:first + _PART] = part
        return table[:, :6], table[:, 6:9], table[:, 9:]

    def _memory(self) -> tuple[Any, ...]:
        observed = self._experiment.controller.velocity == "observer"
        first = 0.0 if observed else None
        return (0.0, 0.0, first) * 3 + (0.0,) * 3 + tuple(self._experiment.tau0.tolist())


def _listed(x: Array) -> Iterator[list[float]]:
    """The rows of `x` as lists, some at a time: all at once they take ten times the room."""
    return chain.from_iterable(x[first:first + _AT_ONCE].tolist() for first in range(0, len(x), _AT_ONCE))


def _fed(experiment: Experiment) -> Iterator[Sequence[float]]:
    """What is added to the feedback [N m], sample by sample: injected excitation and feed-forward."""
    parts = [part for part in (experiment.v, feedforward_of(experiment)) if part is not None]
    return _listed(np.sum(parts, axis=0)) if parts else repeat((0.0, 0.0, 0.0))


def _text(experiment: Experiment, steps: int, handed_on: int) -> str:
    memory = ", ".join([*(f"a{j}, b{j}, d{j}" for j in _JOINTS), *(f"i{j}" for j in _JOINTS), *(f"w{j}" for j in _JOINTS)])
    law = "\n".join(f"        {line}" for j in _JOINTS for line in _lines(experiment, j))
    bent = "".join(f", g{k}" for k in range(handed_on))  # memories of loads, and what is held of the rigid body
    return _LOOP.format(memory=memory, law=law, bent=bent, steps="\n".join([_STEP.format(bent=bent)] * steps))


@lru_cache(maxsize=32)  # experiments of a robot have one controller, mostly
def _code(text: str) -> CodeType:
    return compile(text, "<one RRR arm and its controller>", "exec")


def _lines(experiment: Experiment, j: int) -> list[str]:
    """Command c of joint j (from 1) from its angle q: what the encoder counts, error, estimate, law, steps and limit of the
    command, delay."""
    law, h = experiment.controller, experiment.sample_time

    def own(gain: Array | None) -> float:
        return 0.0 if gain is None else float(gain[j - 1])

    count, fine, limit = own(experiment.resolution), own(law.torque_resolution), law.output_limit
    counted = [f"s{j} = round(s{j} / {count!r}) * {count!r}"] if count > 0.0 else []
    lines = [f"s{j} = q{j} + o{j}", *counted, f"e{j} = s{j} - r{j}"]
    estimate: tuple[str, ...] = _DIFFERENCE
    gains: dict[str, str] = {}
    if law.velocity == "observer" and law.observer_gain is not None:
        estimate, gains = _OBSERVED, {f"k{k + 1}": f"({gain!r})" for k, gain in enumerate(law.observer_gain[j - 1].tolist())}
    lines += [line.format(j=j, h=f"{h!r}", h2=f"{0.5 * h * h!r}", rate=f"{1.0 / h!r}", **gains) for line in estimate]
    integral = ""
    if own(law.ki):
        lines.append(f"i{j} += {h!r} * e{j}")
        integral = f" - ({own(law.ki)!r}) * i{j}"
    lines.append(f"c{j} = f{j} - ({own(law.kp)!r}) * a{j} - ({own(law.kd)!r}) * b{j}{integral}")
    if fine > 0.0:
        lines.append(f"c{j} = round(c{j} * {1.0 / fine!r}) * {fine!r}")
    if limit is not None and np.isfinite(limit[j - 1]):
        lines.append(f"c{j} = min(max(c{j}, {-float(limit[j - 1])!r}), {float(limit[j - 1])!r})")
    return [*lines, f"c{j}, w{j} = w{j}, c{j}"] if law.delay else lines
