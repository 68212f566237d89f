"""The campaign: what each case hides, before anything is recorded: plain data, the same
for the same seed.

    campaign(seed)                every family, shuffled, so that any part is a fair sample
    campaign(seed, ("single",))   one family

A case is known by `SealedCase.key`, a digest of all that is in it: no name of a folder tells a
cause.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields, replace
from itertools import product
from typing import Any

import numpy as np

from bench.faults import fault_names, find_fault
from benchmarks.hidden_effects.robots import ROBOTS

STRENGTHS = (1.0, 0.3, 0.1)  # times the figures of causes.md
MACHINES = 6
JOINTS = (1, 2, 3)
COMPLIANT = (
    "joint_elasticity",
    "base_resonance",
    "backlash",
    "torque_saturation",
)  # a row of their own in the table
OUTSIDE = tuple(name for name in fault_names() if not find_fault(name).known)
EASY = tuple(
    name for name in fault_names() if find_fault(name).known and name not in (*COMPLIANT, "payload")
)
_ABSORBED = {
    "rotor_inertia": (1, 2)
}  # joints of the RRR arm at which a base parameter takes it in (causes.md)
_SESSIONS = ("mixed", "periodic", "friction", "long")


@dataclass(frozen=True)
class Hidden:
    """One cause in one place."""

    cause: str  # name of a fault of the bench
    joint: int | None  # 1-based; None: of the whole arm
    strength: float  # times the figure of causes.md
    seed: int  # of its phases and directions
    once: bool = False  # it happens in one of the logs only


@dataclass(frozen=True)
class SealedCase:
    """One session with one robot, and what ails it."""

    family: str
    hidden: tuple[Hidden, ...]  # what the logs show and the reference logs, if any, do not
    machine: int  # seed of the machine
    seed: int  # of motions, noise and gains
    session: str = "mixed"  # which experiments: see sessions.py
    standing: tuple[Hidden, ...] = ()  # what the reference logs show as well
    reference: bool = False  # with logs from when all but `standing` was in order
    frf: bool = False  # with frequency responses and reversals of every joint
    amplifier: float = 1.0  # times the amplifier's noise
    held: bool = True  # the log says that torque was held over each sample, as it was
    robot: str = "rrr"  # see robots.py
    before: str = ""  # which experiments the reference logs are of, where they are other ones
    loop: str = ""
    """"backward-difference" of the speed, "delayed" torque; else on the observer, a quarter with
    feed-forward."""

    @property
    def key(self) -> str:
        """Ten hexadecimal digits: a digest of all that is not as usual."""
        unusual = [
            (field.name, getattr(self, field.name))
            for field in fields(self)
            if getattr(self, field.name) != field.default
        ]
        return hashlib.blake2b(repr(unusual).encode(), digest_size=5).hexdigest()


def campaign(
    seed: int = 0, families: Iterable[str] = (), short: bool = False
) -> tuple[SealedCase, ...]:
    """All cases of these families (none: all), shuffled.

    Args:
        short: three logs of six seconds in each, instead of 52 s.

    Raises:
        KeyError: there is no such family.
    """
    cases = [case for name in families or FAMILIES for case in FAMILIES[name](seed)]
    order = np.random.default_rng([90, seed]).permutation(len(cases))
    shuffled = tuple(cases[place] for place in order)
    return tuple(replace(case, session="short") for case in shuffled) if short else shuffled


def in_part(key: str, part: str) -> bool:
    """Whether the case of this key belongs to part "i/N": the same one in making and in judging,
    whatever there is already.
    """
    which, parts = (int(number) for number in part.split("/"))
    return int(key, 16) % parts == which - 1


def single(seed: int) -> Iterator[SealedCase]:
    """Every cause that torque and position tell, once at every joint where they do, at every
    strength.
    """
    seen: set[tuple[float, str, int]] = set()
    for place, (strength, (cause, joint)) in enumerate(product(STRENGTHS, _places(EASY))):
        if joint is not None:
            if (strength, cause, joint) in seen:
                continue
            seen.add((strength, cause, joint))
        yield _case("single", seed, place, [(cause, joint, strength)], reference=place % 4 == 3)


def compliance(seed: int) -> Iterator[SealedCase]:
    """Yield the four that torque and position alone do not distinguish."""
    for place, (strength, (cause, joint)) in enumerate(product(STRENGTHS, _places(COMPLIANT))):
        yield _case("compliance", seed, place, [(cause, joint, strength)], frf=True)


def healthy(seed: int, count: int = 100) -> Iterator[SealedCase]:
    """Nothing but the nuisances that every machine has."""
    for place in range(count):
        yield _case("healthy", seed, place, [], reference=place % 4 == 3)


def outside(seed: int) -> Iterator[SealedCase]:
    """Causes that no candidate describes, at full strength and at half of it."""
    for place, (strength, name, turn) in enumerate(product((1.0, 0.5), OUTSIDE, range(2))):
        joint = None if find_fault(name).scope == "arm" else JOINTS[(place + turn) % 3]
        yield _case("outside", seed, place, [(name, joint, strength)])


def invisible(seed: int) -> Iterator[SealedCase]:
    """Yield what base parameters absorb within one session: payload, rotor, a scale of all
    torques.
    """
    for place, strength in enumerate((*STRENGTHS, *STRENGTHS)):
        yield _case("invisible", seed, 4 * place, [("payload", None, strength)])
        for joint in _ABSORBED["rotor_inertia"]:
            yield _case("invisible", seed, 4 * place + joint, [("rotor_inertia", joint, strength)])
        yield _case(
            "invisible", seed, 4 * place + 3, [("torque_gain", joint, strength) for joint in JOINTS]
        )


def payload(seed: int) -> Iterator[SealedCase]:
    """Yield a payload since the reference logs."""
    for place, strength in enumerate(STRENGTHS * 4):
        yield _case("payload", seed, place, [("payload", None, strength)], reference=True)


def pairs(seed: int, count: int = 60) -> Iterator[SealedCase]:
    """Two causes, at full and 0.3 strength."""
    rng = np.random.default_rng([91, seed])
    places = _places(EASY)
    for place in range(count):
        first, second = rng.choice(len(places), 2, replace=False)
        while places[first][0] == places[second][0]:
            second = rng.integers(len(places))
        strengths = rng.choice(STRENGTHS[:2], 2)
        hidden = [
            (*places[which], float(strength))
            for which, strength in zip((first, second), strengths, strict=True)
        ]
        yield _case("pairs", seed, place, hidden)


def noise(seed: int) -> Iterator[SealedCase]:
    """Every cause at one joint, at full and 0.3 strength, with ten times the amplifier's noise."""
    for place, (strength, cause) in enumerate(product(STRENGTHS[:2], EASY)):
        joints = [joint for name, joint in _places(EASY) if name == cause]
        yield _case(
            "noise", seed, place, [(cause, joints[place % len(joints)], strength)], amplifier=10.0
        )


def standing(seed: int) -> Iterator[SealedCase]:
    """Yield a cause that was there from the first day, with reference logs: nothing has changed."""
    for place, cause in enumerate(name for name in EASY if name != "contact"):
        joints = [joint for name, joint in _places(EASY) if name == cause]
        there = [(cause, joints[place % len(joints)], STRENGTHS[place % 2])]
        case = _case("standing", seed, place, there, reference=True)
        yield replace(case, hidden=(), standing=case.hidden)


def zero(seed: int) -> Iterator[SealedCase]:
    """Causes of no strength."""
    for place, cause in enumerate(EASY[::2]):
        joints = [joint for name, joint in _places(EASY) if name == cause]
        yield _case("zero", seed, place, [(cause, joints[place % len(joints)], 1e-6)])


def uncentred(seed: int, count: int = 12) -> Iterator[SealedCase]:
    """Healthy arms whose logs claim that torque was sampled: it then is not centred, and shows as a
    delay.
    """
    for place in range(count):
        yield _case("uncentred", seed, place, [], held=False)


def paper(seed: int) -> Iterator[SealedCase]:
    """Arms with friction of three sigmoids, as the paper has it, and reference logs: in order, or
    with one cause more.
    """
    for place in range(8):
        yield _case("paper", seed, place, [], reference=True, robot="paper")
    for place, (strength, cause) in enumerate(product(STRENGTHS[:2], EASY), start=8):
        joints = [joint for name, joint in _places(EASY) if name == cause]
        yield _case(
            "paper",
            seed,
            place,
            [(cause, joints[place % len(joints)], strength)],
            reference=True,
            robot="paper",
        )


def elsewhere(seed: int) -> Iterator[SealedCase]:
    """Other arms under other loops, at full strength: in order, or with one cause."""
    robots, loops = tuple(ROBOTS), ("", "backward-difference", "delayed")
    for place in range(2 * len(robots)):
        yield _case(
            "elsewhere",
            seed,
            place,
            [],
            robot=robots[place % len(robots)],
            loop=loops[place % len(loops)],
        )
    causes = [
        cause for cause in EASY if cause not in ("rotor_inertia", "link_length")
    ]  # where they show depends on the arm
    for place, (cause, turn) in enumerate(product(causes, range(2)), start=2 * len(robots)):
        robot = robots[place % len(robots)]
        joint = (
            None
            if find_fault(cause).scope == "arm"
            else 1 + (place + turn) % ROBOTS[robot].n_joints
        )
        yield _case(
            "elsewhere",
            seed,
            place,
            [(cause, joint, 1.0)],
            robot=robot,
            loop=loops[place // 2 % len(loops)],
        )


def unlike(seed: int) -> Iterator[SealedCase]:
    """Yield reference logs of another motion than all later logs: in order, or with one cause at
    full strength.
    """
    ways = (("slow", "fast"), ("fast", "slow"))
    for place in range(16):
        now, before = ways[place // 2 % 2]
        yield _case(
            "unlike",
            seed,
            place,
            [],
            reference=True,
            robot=("rrr", "paper")[place % 2],
            session=now,
            before=before,
        )
    for place, cause in enumerate(EASY, start=16):
        joints = [joint for name, joint in _places(EASY) if name == cause]
        now, before = ways[place // 2 % 2]
        yield _case(
            "unlike",
            seed,
            place,
            [(cause, joints[place % len(joints)], 1.0)],
            reference=True,
            robot=("rrr", "paper")[place % 2],
            session=now,
            before=before,
        )


FAMILIES: dict[str, Callable[[int], Iterable[SealedCase]]] = {
    each.__name__: each
    for each in (
        single,
        compliance,
        healthy,
        outside,
        invisible,
        payload,
        pairs,
        noise,
        standing,
        zero,
        uncentred,
        paper,
        elsewhere,
        unlike,
    )
}


def _places(causes: Iterable[str]) -> list[tuple[str, int | None]]:
    """Each cause at each joint where it can be seen; three times where it belongs to the whole
    arm.
    """
    found: list[tuple[str, int | None]] = []
    for cause in causes:
        whole = find_fault(cause).scope == "arm"
        seen = [joint for joint in JOINTS if joint not in _ABSORBED.get(cause, ())]
        found += [(cause, None if whole else seen[turn % len(seen)]) for turn in range(len(JOINTS))]
    return found


def _case(
    family: str,
    seed: int,
    place: int,
    hidden: Iterable[tuple[str, int | None, float]],
    **others: Any,
) -> SealedCase:
    rng = np.random.default_rng([92, seed, place, *family.encode()])
    own = (
        100_000 * seed + 1000 * list(FAMILIES).index(family) + place
    )  # no two cases share motions or noise
    causes = tuple(
        Hidden(cause, joint, strength, own, once=cause == "contact" and place % 2 == 0)
        for cause, joint, strength in hidden
    )
    case = SealedCase(
        family,
        causes,
        100 * seed + (place + place // MACHINES) % MACHINES,
        own,
        _SESSIONS[int(rng.integers(len(_SESSIONS)))],
    )
    return replace(case, **others)
