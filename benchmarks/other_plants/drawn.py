"""Cases drawn at random, of arms, laws of friction, loops, motions and faults in any combination.

drawn(40, seed=3)       the same forty whenever they are asked for
pairs(20, seed=3)       arms with two faults
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.other_plants.arms import ARMS
from benchmarks.other_plants.cases import BEFORE, DELAY, FIVE, FOUR, SLOW, THREE, Case

_LAWS = ("tanh", "root", "arctan")
_HEALTHY, _OUTSIDE = 0.45, 0.1  # of the cases
_REFERENCE = 0.25
_ARTICULATED = ("planar", "upright", "scara", "six")
_UNDER_LOAD = {"lift": (1,), "planar": (1, 2), "upright": (2, 3), "six": (2, 3)}
_EVERY = {name: tuple(range(1, len(arm.axes) + 1)) for name, arm in ARMS.items()}
_TURNING = {
    name: tuple(
        k for k, axis in enumerate(arm.axes, start=1) if not axis.slide and axis.reach >= 1.2
    )
    for name, arm in ARMS.items()
    if name in ("pendulum", "planar", "upright", "scara", "wrist", "six")
}
_LONG = {
    "planar": (2,),
    "upright": (3,),
    "scara": (2,),
    "six": (3,),
}  # the link before it carries much
_COUPLED = {"planar": (1, 2), "upright": (2, 3), "scara": (1, 2), "six": (2, 3), "wrist": (1, 2, 3)}
# Of two joints only the ratio of their scales shows: one too weak is the other too strong.
_SCALED = {name: joints for name, joints in _COUPLED.items() if name != "planar"}
# A constant force on a slide that gravity pulls along is its weight, which is unknown.
_FREE = {
    "pendulum": (1,),
    "table": (1, 2),
    "planar": (1, 2),
    "upright": (1, 2, 3),
    "scara": (1, 2, 4),
    "gantry": (1, 2),
    "wrist": (1, 2, 3),
    "six": (1, 2, 3, 4, 5, 6),
}


def drawn(count: int, seed: int) -> tuple[Case, ...]:
    """`count` cases."""
    rng = np.random.default_rng([20040601, seed])
    return tuple(replace(_one(rng), number_in_name=1000 * seed + k) for k in range(1, count + 1))


def pairs(count: int, seed: int) -> tuple[Case, ...]:
    """`count` cases with two faults that share no right answer."""
    rng = np.random.default_rng([20040602, seed])
    return tuple(replace(_pair(rng), number_in_name=1000 * seed + k) for k in range(1, count + 1))


def _pair(rng: np.random.Generator) -> Case:
    while True:
        plain = _plain(rng, str(rng.choice(sorted(ARMS))))
        kinds = rng.choice(sorted(_FAULTS), 2, replace=False)
        first, second = (_FAULTS[kind](plain, rng) for kind in kinds)
        if first.arm == second.arm and not (set(first.answers) & set(second.answers)):
            return replace(
                first,
                beside=second,
                sample_time=min(first.sample_time, second.sample_time),
                duration=max(first.duration, second.duration),
                motions=max(first.motions, second.motions, key=len),
            )


def _one(rng: np.random.Generator) -> Case:
    kind = rng.random()
    plain = _plain(rng, str(rng.choice(sorted(ARMS))))
    if kind < _HEALTHY:
        if rng.random() < 0.2:
            return replace(
                plain, law=str(rng.choice(["stribeck", "lugre"])), motions=FIVE, answers=SLOW
            )
        return plain
    if kind > 1.0 - _OUTSIDE:
        return _outside(plain, rng)
    return _FAULTS[sorted(_FAULTS)[rng.integers(len(_FAULTS))]](plain, rng)


def _plain(rng: np.random.Generator, arm: str) -> Case:
    loop = str(
        rng.choice(["pd", "pid", "pid", "pd+gravity", "cascade", "cascade", "computed torque"])
    )
    motions = (THREE, FOUR, FOUR, FIVE)[rng.integers(4)]
    if rng.random() < _REFERENCE:
        motions = (*BEFORE, *FOUR)
    fast = 5e-4 if arm != "six" else 1e-3
    return Case(
        arm,
        str(rng.choice(_LAWS)),
        loop,
        float(rng.choice([fast, 1e-3, 1e-3, 1e-3, 2e-3, 4e-3])),
        resolution=float(rng.choice([1e-5, 1e-5, 5e-5, 1e-4])),
        noise=float(rng.choice([0.002, 0.004, 0.01])),
        coloured=bool(rng.random() < 0.2),
        motions=motions,
        duration=float(rng.choice([10.0, 12.0, 15.0])),
    )


def _outside(plain: Case, rng: np.random.Generator) -> Case:
    if len(ARMS[plain.arm].axes) > 1 and rng.random() < 0.5:
        joint, other = rng.choice(len(ARMS[plain.arm].axes), 2, replace=False)
        return replace(
            plain, fault="heat from another joint", joint=int(joint) + 1, number=int(other)
        )
    return replace(
        plain, fault="hopping torque", joint=int(rng.integers(len(ARMS[plain.arm].axes))) + 1
    )


def _at(
    plain: Case,
    rng: np.random.Generator,
    where: dict[str, tuple[int, ...]],
    fault: str,
    size: float = 0.0,
    number: float = 0.0,
) -> Case:
    """Put the fault at one of the joints that can have it, of another arm where this one has
    none.
    """
    arm = plain.arm if plain.arm in where else str(rng.choice(sorted(where)))
    return replace(
        plain,
        arm=arm,
        fault=fault,
        joint=int(rng.choice(where[arm])),
        size=size,
        number=number,
        answers=(fault,),
    )


def _signed(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.uniform(low, high) * rng.choice([-1.0, 1.0]))


def _cogging(plain: Case, rng: np.random.Generator) -> Case:
    joint = int(rng.integers(len(ARMS[plain.arm].axes)))
    waves = (
        2.0 * np.pi / rng.uniform(0.015, 0.06)
        if ARMS[plain.arm].axes[joint].slide
        else rng.uniform(4.0, 30.0)
    )
    return replace(
        plain, fault="cogging", joint=joint + 1, number=float(waves), answers=("cogging",)
    )


def _spring(plain: Case, rng: np.random.Generator) -> Case:
    made = _at(plain, rng, _FREE, "spring")
    return replace(made, number=float(ARMS[made.arm].axes[made.joint - 1].home))


def _tilt(plain: Case, rng: np.random.Generator) -> Case:
    made = _at(
        plain,
        rng,
        dict.fromkeys(("upright", "scara", "six"), (1,)),
        "gravity_tilt",
        rng.uniform(0.04, 0.1),
    )
    return replace(made, number=rng.uniform(0.0, 2.0 * np.pi))


def _delay(plain: Case, rng: np.random.Generator) -> Case:
    slow = replace(
        plain,
        sample_time=min(plain.sample_time, 2e-3),
        fault="torque_delay",
        size=0.004,
        answers=DELAY,
    )
    return replace(slow, size=float(rng.integers(2, 5)) * max(slow.sample_time, 1e-3))


def _crosstalk(plain: Case, rng: np.random.Generator) -> Case:
    made = _at(plain, rng, _COUPLED, "torque_crosstalk", _signed(rng, 0.1, 0.2))
    others = [joint - 1 for joint in _COUPLED[made.arm] if joint != made.joint]
    return replace(made, number=float(rng.choice(others)))


def _payload(plain: Case, rng: np.random.Generator) -> Case:
    made = _at(plain, rng, dict.fromkeys(_ARTICULATED, (1,)), "payload", rng.uniform(0.3, 0.8))
    return replace(made, motions=(*BEFORE, *FOUR))


def _drift(plain: Case, rng: np.random.Generator) -> Case:
    made = _at(plain, rng, _FREE, "viscous_drift", _signed(rng, 0.5, 0.9))
    return replace(made, motions=FOUR, duration=15.0)


def _position(plain: Case, rng: np.random.Generator) -> Case:
    made = _at(plain, rng, _EVERY, "position_friction", rng.uniform(0.25, 0.5))
    slides = ARMS[made.arm].axes[made.joint - 1].slide
    return replace(
        made, number=2.0 * np.pi / rng.uniform(0.1, 0.2) if slides else float(rng.integers(1, 4))
    )


def _lag(plain: Case, rng: np.random.Generator, fault: str) -> Case:
    """Where rows know little of each other, a drive that is slow and an encoder that is late are
    one.
    """
    made = _at(plain, rng, _EVERY, fault, rng.uniform(0.004, 0.008))
    made = replace(made, sample_time=min(plain.sample_time, 2e-3))
    if fault == "time_delay":
        made = replace(made, size=round(made.size / made.sample_time) * made.sample_time)
    return (
        made if fault == "torque_lag" or made.arm in _ARTICULATED else replace(made, answers=DELAY)
    )


def _encoder(plain: Case, rng: np.random.Generator) -> Case:
    made = _at(plain, rng, _TURNING, "encoder_eccentricity", rng.uniform(0.003, 0.006))
    return replace(made, number=rng.uniform(0.0, 2.0 * np.pi))


def _misread(plain: Case, rng: np.random.Generator) -> Case:
    made = _at(plain, rng, _COUPLED, "encoder_crosstalk", _signed(rng, 0.015, 0.03))
    others = [joint - 1 for joint in _COUPLED[made.arm] if joint != made.joint]
    return replace(made, number=float(rng.choice(others)))


def _touch(plain: Case, rng: np.random.Generator) -> Case:
    made = _at(
        plain,
        rng,
        dict.fromkeys(_ARTICULATED, (1,)),
        "contact",
        rng.uniform(15.0, 40.0),
        rng.uniform(-1.0, 1.0),
    )
    return replace(made, motions=(FOUR, FIVE)[rng.integers(2)])


_FAULTS: dict[str, Callable[[Case, np.random.Generator], Case]] = {
    "torque_offset": lambda plain, rng: _at(plain, rng, _FREE, "torque_offset"),
    "cogging": _cogging,
    "spring": _spring,
    "gravity_tilt": _tilt,
    "torque_delay": _delay,
    "torque_crosstalk": _crosstalk,
    "payload": _payload,
    "viscous_drift": _drift,
    "position_friction": _position,
    "encoder_eccentricity": _encoder,
    "encoder_crosstalk": _misread,
    "contact": _touch,
    "time_delay": lambda plain, rng: _lag(plain, rng, "time_delay"),
    "drive_lag": lambda plain, rng: _lag(plain, rng, "drive_lag"),
    "torque_lag": lambda plain, rng: _lag(plain, rng, "torque_lag"),
    "link_length": lambda plain, rng: _at(
        plain, rng, _LONG, "link_length", _signed(rng, 0.012, 0.025)
    ),
    "quadratic_drag": lambda plain, rng: _at(
        plain, rng, _EVERY, "quadratic_drag", rng.uniform(0.1, 0.25)
    ),
    "concave_friction": lambda plain, rng: _at(
        plain, rng, _EVERY, "concave_friction", rng.uniform(0.3, 0.5), rng.uniform(0.5, 1.0)
    ),
    "torque_saturation": lambda plain, rng: _at(
        plain, rng, _COUPLED, "torque_saturation", rng.uniform(1.3, 1.8)
    ),
    "torque_gain": lambda plain, rng: _at(
        plain, rng, _SCALED, "torque_gain", _signed(rng, 0.08, 0.2)
    ),
    "asymmetric_friction": lambda plain, rng: _at(
        plain, rng, _FREE, "asymmetric_friction", rng.uniform(0.15, 0.4)
    ),
    "load_friction": lambda plain, rng: _at(
        plain, rng, _UNDER_LOAD, "load_friction", rng.uniform(0.06, 0.15)
    ),
}
