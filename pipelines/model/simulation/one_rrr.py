"""One RRR arm without arrays: for a single robot plain numbers are several times faster than arrays of three.

The same (A5) of Kostić et al. 2004 as `ManyRRR`, gathered by what needs the fewest products, and the same Runge-Kutta step. The
step is written out as Python text with the arm's numbers in it, and compiled once for each arm: calls and look-ups of constants
would cost as much as the arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from math import nan
from types import CodeType
from typing import Any

import numpy as np

from pipelines.model.effects.terms import WRITTEN, Formula, OwnLoad, PlainDrive
from pipelines.model.rigid.body import Array
from pipelines.model.rigid.rrr import RRR
from pipelines.model.simulation.plant import Plant

__all__ = ["KUTTA", "POSED", "OneRRR", "Step", "acceleration_of", "memories", "numbers_of", "written"]

# u - τ_f(v) - c - h at angles {q2}, {q3} and speeds {v1} {v2} {v3}, into r; cofactors of D, all but two, into C, and 1 / det D into
# scale; S = q2 + q3.
POSED = """
    x2 = {q2}{offset2}
    x3 = {q3}{offset3}
    c2 = cos(x2)
    s2 = sin(x2)
    c3 = cos(x3)
    s3 = sin(x3)
    cS = c2 * c3 - s2 * s3
    sS = s2 * c3 + c2 * s3
    lever = {p3} * cS - {p4} * sS
    across = {twice_a2} * ({p3} * sS + {p4} * cS) * c2
    near = {a2_p3} * c3 - {a2_p4} * s3
    bent = {a2_p3} * s3 + {a2_p4} * c3
    d0 = {p8} * cS + {p9} * sS
    D13 = d0 + {m13}
    D12 = d0 + {p10} * c2 + {p11} * s2 + {m12}
    D11 = ({p1} * c2 + {p2} * s2 + {twice_a2} * lever) * c2 + ({p5} * cS - {p6} * sS) * cS + {e11}
    D22 = {e22} + near + near
    D23 = {e23} + near
    outer = {twice_p5} * sS * cS + {p6} * (cS * cS - sS * sS) + across
    upper = {twice_p1} * s2 * c2 - {p2} * (c2 * c2 - s2 * s2) + outer + across - bent - bent
    v = {v2} + {v3}
    half = 0.5 * {v1} * {v1}
    h3 = {g} * lever
    r1 = {u1} - ({friction1}) + {v1} * ({v2} * upper + {v3} * outer) - v * v * ({p9} * cS - {p8} * sS) \\
        - {v2} * {v2} * ({p11} * c2 - {p10} * s2)
    r2 = {u2} - ({friction2}) - half * upper + (v + {v2}) * {v3} * bent - h3 - {g_p14} * c2 + {g_p15} * s2
    r3 = {u3} - ({friction3}) - half * outer - {v2} * {v2} * bent - h3
    C11 = D22 * {e33} - D23 * D23
    C12 = D13 * D23 - D12 * {e33}
    C13 = D12 * D23 - D13 * D22
    C23 = D12 * D13 - D11 * D23
    scale = 1.0 / (D11 * C11 + D12 * C12 + D13 * C13)
"""
# dq = D⁻¹ (u - τ_f(v) - c - h), into {a1} {a2} {a3}.
_ACCELERATION = "{driven}" + POSED + """
    {a1} = (C11 * r1 + C12 * r2 + C13 * r3) * scale
    {a2} = (C12 * r1 + (D11 * {e33} - D13 * D13) * r2 + C23 * r3) * scale
    {a3} = (C13 * r1 + C23 * r2 + (D11 * D22 - D12 * D12) * r3) * scale
"""

# Kutta's stages k, l, m, n, after the first: the slope of the position is the speed of the stage. Memories begin a stage with their
# rates.
KUTTA = """
    w1 = v1 + {half} * k1
    w2 = v2 + {half} * k2
    w3 = v3 + {half} * k3
    y1 = q1 + {half} * v1
    y2 = q2 + {half} * v2
    y3 = q3 + {half} * v3
{after_first}
{second}
    z1 = v1 + {half} * l1
    z2 = v2 + {half} * l2
    z3 = v3 + {half} * l3
    y1 = q1 + {half} * w1
    y2 = q2 + {half} * w2
    y3 = q3 + {half} * w3
{after_second}
{third}
    o1 = v1 + {h} * m1
    o2 = v2 + {h} * m2
    o3 = v3 + {h} * m3
    y1 = q1 + {h} * z1
    y2 = q2 + {h} * z2
    y3 = q3 + {h} * z3
{after_third}
{fourth}
    return (q1 + {sixth} * (v1 + 2.0 * (w1 + z1) + o1), q2 + {sixth} * (v2 + 2.0 * (w2 + z2) + o2),
            q3 + {sixth} * (v3 + 2.0 * (w3 + z3) + o3), v1 + {sixth} * (k1 + 2.0 * (l1 + m1) + n1),
            v2 + {sixth} * (k2 + 2.0 * (l2 + m2) + n2), v3 + {sixth} * (k3 + 2.0 * (l3 + m3) + n3){remembered})
"""
_STEP = """
def step(q1, q2, q3, v1, v2, v3, {memories}u1, u2, u3, cos=cos, sin=sin, tanh=tanh{called}):
{begin}
{first}
""" + KUTTA
# The slope of the speed alone.
_SLOPE = """
def acceleration(q1, q2, q3, v1, v2, v3, u1, u2, u3, cos=cos, sin=sin, tanh=tanh{called}):
{first}
    return k1, k2, k3
"""
_STAGES = {"first": ("q", "v", "k"), "second": ("y", "w", "l"), "third": ("y", "z", "m"), "fourth": ("y", "o", "n")}

Step = Callable[..., tuple[float, ...]]
_Acceleration = Callable[..., tuple[float, float, float]]


class OneRRR:
    """The integrator of one arm that nothing moves but rigid body, friction, loads of single joints, some of which remember one
    number, and drives that change a command in plain numbers; used as `RungeKutta` is."""

    def __init__(self, plant: Plant, sample_time: float, steps: int) -> None:
        """`plant` as `fits` it; `steps` of equal size make one control sample."""
        self.step = _compiled(plant, sample_time / steps)
        self._steps = steps

    @staticmethod
    def fits(plant: Plant) -> bool:
        return plant.plain and isinstance(plant.body, RRR) and plant.p.size == 15

    def advance(self, t: Array, state: Array, states: Array, command: Array) -> Array:
        """Move `state` (6, 1) on by one sample, in place, and return the memories' new states; nothing depends on time."""
        del t
        step, torque = self.step, command[:, 0].tolist()
        now: tuple[float, ...] = (*state[:, 0].tolist(), *states[0].tolist())
        try:
            for _ in range(self._steps):
                now = step(*now, *torque)
        except (ValueError, OverflowError):  # of an infinite number there is no sine
            now = (nan,) * len(now)
        state[:, 0] = now[:6]
        return np.array([now[6:]])


def _compiled(plant: Plant, h: float) -> Step:
    """(q1, q2, q3, v1, v2, v3, memories, u1, u2, u3) -> all but u after a step of length h [s]."""
    lengths = {"h": repr(h), "half": repr(0.5 * h), "sixth": repr(h / 6.0)}
    joints = [joint for joint, _ in plant.own_memories]
    step: Step = written(_STEP, plant, joints, plant.drives, **lengths, **memories(joints, **lengths))["step"]
    return step


def memories(joints: Sequence[int], h: str, half: str, sixth: str) -> dict[str, str]:
    """What becomes of the memory b of each load at `joints` (0-based), and its rate r, from stage to stage."""
    numbered = list(enumerate(joints))

    def stage(letter: str, speed: str, length: str = "", before: str = "") -> str:
        moved = [f"    b{k}{letter} = b{k}k + {length} * r{k}{before}" for k, _ in numbered] if before else []
        return "\n".join([*moved, *(f"    r{k}{letter} = rate{k}(b{k}{letter}, {speed}{joint + 1})" for k, joint in numbered)])

    return {"memories": "".join(f"b{k}k, " for k, _ in numbered), "begin": stage("k", "v"),
            "after_first": stage("l", "w", half, "k"), "after_second": stage("m", "z", half, "l"),
            "after_third": stage("n", "o", h, "m"),
            "remembered": "".join(f", b{k}k + {sixth} * (r{k}k + 2.0 * (r{k}l + r{k}m) + r{k}n)" for k, _ in numbered)}


def acceleration_of(plant: Plant) -> _Acceleration:
    """(q1, q2, q3, v1, v2, v3, u1, u2, u3) -> accelerations, of the rigid body, friction and the loads of single joints."""
    found: _Acceleration = written(_SLOPE, plant)["acceleration"]
    return found


def written(text: str, plant: Plant, remembering: Sequence[int] = (), drives: Sequence[PlainDrive] = (),
            stage: str = _ACCELERATION, **more: str) -> dict[str, Any]:
    """What `text` defines, compiled with the arm's numbers in it; `remembering`: joints (0-based) of its memories; `drives` that
    commands pass; `stage`: what stands for {first} to {fourth}."""
    numbers = numbers_of(plant)
    stages = {name: stage.format(**numbers, **_names(plant, remembering, *letters), **_driven(len(drives), letters[1]))
              for name, letters in _STAGES.items()}
    own = [memory for _, memory in plant.own_memories] if remembering else []
    several = {"load": [load for _, load in plant.own_loads], "rate": [one.rate for one in own], "bend": [one.load for one in own],
               "drive": drives}
    called = {f"{name}{k}": one for name, some in several.items() for k, one in enumerate(some)}
    scope: dict[str, Any] = {**WRITTEN, **called}
    exec(_code(text.format(**stages, called="".join(f", {name}={name}" for name in called), **more)), scope)
    return scope


def _driven(drives: int, speed: str) -> dict[str, str]:
    """What comes of the command in one stage, as text, and the names of what reaches the joints."""
    speeds = ", ".join(f"{speed}{j}" for j in (1, 2, 3))
    lines = [f"    t1, t2, t3 = drive{k}(({'t1, t2, t3' if k else 'u1, u2, u3'}), ({speeds}))" for k in range(drives)]
    return {"driven": "\n".join(lines), **{f"u{j}": f"{'t' if drives else 'u'}{j}" for j in (1, 2, 3)}}


@lru_cache(maxsize=32)  # an arm is run again and again: in each experiment, with each noise, with halved steps
def _code(text: str) -> CodeType:
    return compile(text, "<one RRR arm>", "exec")


def numbers_of(plant: Plant) -> dict[str, str]:
    """Every constant of `_ACCELERATION` as the text of a number, a negative one in brackets."""
    p = dict(zip([f"p{k}" for k in range(1, 16)], plant.p.reshape(15).tolist(), strict=True))
    joints, g = plant.body.robot.joints, -plant.body.robot.gravity[2]
    a2, m = joints[1].a, plant.added.tolist()
    values = p | {
        "twice_a2": 2.0 * a2, "a2_p3": a2 * p["p3"], "a2_p4": a2 * p["p4"], "twice_p1": 2.0 * p["p1"], "twice_p5": 2.0 * p["p5"],
        "m12": m[0][1], "m13": m[0][2], "e11": p["p7"] + m[0][0], "e22": p["p12"] + m[1][1], "e23": p["p13"] + m[1][2],
        "e33": p["p13"] + m[2][2], "g": g, "g_p14": g * p["p14"], "g_p15": g * p["p15"]}
    offsets = {f"offset{k}": f" + {joints[k - 1].offset!r}" if joints[k - 1].offset else "" for k in (2, 3)}
    return {name: f"({value!r})" for name, value in values.items()} | offsets


def _names(plant: Plant, remembering: Sequence[int], position: str, speed: str, slope: str) -> dict[str, str]:
    """The variables of one stage, and friction with the loads of single joints as text over them."""
    names = {f"{kind}{k}": f"{letter}{k}" for kind, letter in (("q", position), ("v", speed), ("a", slope)) for k in (1, 2, 3)}
    curves = plant.curves
    for j in range(3):
        v = f"{speed}{j + 1}"
        sigmoids = zip(curves.heights[:, j].tolist(), curves.sharpnesses[:, j].tolist(), strict=True)
        terms = [f"({curves.viscous[j].item()!r}) * {v}", *(f"({f!r}) * tanh({w!r} * {v})" for f, w in sigmoids if f)]
        terms += [_load(load, k, f"{position}{j + 1}", v) for k, (joint, load) in enumerate(plant.own_loads) if joint == j]
        terms += [f"bend{k}(b{k}{slope}, r{k}{slope})" for k, joint in enumerate(remembering) if joint == j]
        names[f"friction{j + 1}"] = " + ".join([*terms, repr(curves.constant[j].item())] if curves.constant[j] else terms)
    return names


def _load(load: OwnLoad, number: int, q: str, v: str) -> str:
    """What a load of one joint is at angle and speed, as text."""
    return f"({load.text.format(q=q, v=v)})" if isinstance(load, Formula) else f"load{number}({q}, {v})"
