"""One RRR arm without arrays whose rigid body is held over each step, as `HeldBody` does it for other arms.

    step = OneHeld(plant, sample_time, steps)
    now = (*now, *step.held(now))             what a first step begins with

    dq = D⁻¹ (u - τ_f(v) - b),   b = c + h

Friction turns over within a fraction of a step, and is worked out at each of Kutta's stages. D⁻¹ and b change with the posture, and
are worked out once, in the middle of the step: of second order in its length. The state in the middle is told from the acceleration
that the last step's D and b give now.
"""

from __future__ import annotations

from pipelines.model.simulation.one_rrr import KUTTA, POSED, Step, memories, numbers_of, written
from pipelines.model.simulation.plant import Plant

__all__ = ["HELD", "OneHeld"]

_INVERSE, _BIAS = ("i11", "i12", "i13", "i22", "i23", "i33"), ("g1", "g2", "g3")  # D⁻¹ and -b
HELD = (*_INVERSE, *_BIAS)

# Into {a1} {a2} {a3}, of D and b as they are held.
_STAGE = """
{driven}
    f1 = {u1} - ({friction1})
    f2 = {u2} - ({friction2})
    f3 = {u3} - ({friction3})
    d1 = f1 + g1
    d2 = f2 + g2
    d3 = f3 + g3
    {a1} = i11 * d1 + i12 * d2 + i13 * d3
    {a2} = i12 * d1 + i22 * d2 + i23 * d3
    {a3} = i13 * d1 + i23 * d2 + i33 * d3
"""
_HOLD = """
    i11 = C11 * scale
    i12 = C12 * scale
    i13 = C13 * scale
    i22 = (D11 * {e33} - D13 * D13) * scale
    i23 = C23 * scale
    i33 = (D11 * D22 - D12 * D12) * scale
    g1 = r1
    g2 = r2
    g3 = r3
"""
_STEP = """
def step(q1, q2, q3, v1, v2, v3, {memories}{held}, u1, u2, u3, cos=cos, sin=sin, tanh=tanh{called}):
{begin}
{first}
    y2 = q2 + {half} * v2 + {eighth} * k2
    y3 = q3 + {half} * v3 + {eighth} * k3
    w1 = v1 + {half} * k1
    w2 = v2 + {half} * k2
    w3 = v3 + {half} * k3
{middle}
    d1 = f1 + g1
    d2 = f2 + g2
    d3 = f3 + g3
    k1 = i11 * d1 + i12 * d2 + i13 * d3
    k2 = i12 * d1 + i22 * d2 + i23 * d3
    k3 = i13 * d1 + i23 * d2 + i33 * d3
""" + KUTTA
_FIRST = """
def first(y2, y3, w1, w2, w3, cos=cos, sin=sin{called}):
{middle}
    return {held}
"""


class OneHeld:
    """One arm as `OneRRR` fits it."""

    def __init__(self, plant: Plant, sample_time: float, steps: int) -> None:
        """`plant` as `OneRRR` fits it; `steps` of equal size make one control sample."""
        self.step = _compiled(plant, sample_time / steps)
        self._first: Step = written(_FIRST, plant, middle=_middle(plant), held=", ".join(HELD))["first"]

    def held(self, now: tuple[float, ...]) -> tuple[float, ...]:
        """D⁻¹ and -b in the state `now` (q1, q2, q3, v1, v2, v3, ...), which a step takes behind the memories."""
        return self._first(*now[1:6])


def _compiled(plant: Plant, h: float) -> Step:
    """(q1, q2, q3, v1, v2, v3, memories, D⁻¹ and -b, u1, u2, u3) -> all but u after a step of length h [s]."""
    lengths = {"h": repr(h), "half": repr(0.5 * h), "sixth": repr(h / 6.0)}
    joints = [joint for joint, _ in plant.own_memories]
    named, more = ", ".join(HELD), memories(joints, **lengths)
    more["remembered"] += f", {named}"
    step: Step = written(_STEP, plant, joints, plant.drives, _STAGE, **lengths, **more, held=named, eighth=repr(0.125 * h * h),
                         middle=_middle(plant))["step"]
    return step


def _middle(plant: Plant) -> str:
    """D⁻¹ and -b of a state, as text: what no torque and no friction would do."""
    nothing = {f"{name}{k}": "0.0" for name in ("u", "friction") for k in (1, 2, 3)}
    numbers = numbers_of(plant)
    state = {"q2": "y2", "q3": "y3", "v1": "w1", "v2": "w2", "v3": "w3"}
    return POSED.format(**numbers, **nothing, **state) + _HOLD.format(**numbers)
