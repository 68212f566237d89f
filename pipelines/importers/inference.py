"""Weigh the evidence for the clock, positions and torques of a recording.

Names, lines of the file, numbers and the robot's links are the evidence. Each finding is a value
with its confidence and reasons; where these contradict each other, or say nothing, the value is ""
and the draft has a blank. `units_of_draft` judges numbers, `guess` writes the findings as a recipe.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from pipelines.errors import clean
from pipelines.importers.clock import SECONDS, clock_as_stated, round_rate
from pipelines.importers.config import EVIDENCE
from pipelines.importers.evidence import (
    Guess,
    LinkFit,
    Slope,
    fits_by_unit,
    quarter_turns,
    sign_of,
    units_of_ratio,
    unlike_links,
)
from pipelines.importers.groups import Group, unit_of_group
from pipelines.importers.notes import (
    Statement,
    stated_counts,
    stated_gear,
    stated_rate,
    stated_unit,
)
from pipelines.importers.raw import RawTable
from pipelines.importers.recording import BY_FILE, WITHOUT_NAME, Reading, matrix
from pipelines.importers.units_of_draft import (
    PositionEvidence,
    is_share,
    position_unit,
    slide_unit,
    torque_unit,
)
from pipelines.io.log import Array
from pipelines.io.robot import Joint, RobotDescription
from pipelines.io.units import UNITS

# Parts of an arm.
_BASE_TO_TIP = ("base", "torso", "waist", "shoulder", "elbow", "forearm", "wrist", "hand")
# Mechanics, ROS: velocities in the positions' unit of angle.
_ONE_UNIT = frozenset({"q", "qpos", "jpos", "effort", "efforts"})
# Units that the torque is compared in; and that of names or lines of the file.
_ANGLES, _NAMED = ("rad", "deg", "rev"), "as named"
_MOTOR_SIDE = re.compile(
    r"(motor|rotor|drive)[ _-]*(side|shaft|seit)|before the gear", re.IGNORECASE
)

Model = Callable[[RobotDescription, Array, Array, Array], Array | None]


class Inference:
    """The findings about one recording. Not frozen: later ones rest on earlier ones."""

    def __init__(self, reading: Reading, model: Model | None) -> None:
        self.reading, self.model = reading, model
        q, tau, clock = reading.q.group, reading.tau.group, reading.clock
        notes = reading.table.notes
        self.q = matrix(reading.table, q.columns) if q else None
        self.tau = matrix(reading.torque_table, tau.columns) if tau else None
        self.n = reading.joints
        self.current = tau is not None and tau.quantity == "current"
        arm = reading.arm.robot
        self.joints: tuple[Joint, ...] = arm.joints if arm is not None else ()
        self.clock_unit, self.clock_guess = "", Guess("", "unsure", "")
        self.t: Array | None = None  # [s]
        stated, self.counts = stated_rate(notes), stated_counts(notes)
        # Of q against dq, per second (or sample).
        self.slope = reading.slope if clock is None else None
        self.rate, self.rate_guess = self._rate(stated)
        if clock is not None:
            found = clock_as_stated(clock, self.q, reading.slope, notes, stated)
            self.clock_unit, self.clock_guess = found
            factor = 1.0 if clock.paired else SECONDS.get(self.clock_unit)
            if self.clock_unit == "sample" and self.rate > 0.0:
                factor = 1.0 / self.rate
            if factor is not None:
                self.t = clock.values * factor
                slope = reading.slope
                self.slope = slope and Slope(slope.factor / factor, slope.correlation)
        self.fits: dict[str, LinkFit] = {}  # by the unit of the positions
        self.fits = self._fits()

    def _rate(self, stated: Statement | None) -> tuple[float, Guess]:
        """Return the rate [Hz] that the file states or, without a clock, a velocity shows.

        It is nan where none does, or a velocity contradicts it.
        """
        slope, unknown = self.slope, (math.nan, Guess("", "unsure", ""))
        if stated is not None:
            agrees = slope is None or units_of_ratio(slope.factor * stated.number) is not None
            rate = stated.number if math.isfinite(stated.number) and agrees else math.nan
            return rate, Guess(f"{rate:g} Hz", "likely", f"the file states {stated.words}")
        if self.reading.clock is not None or slope is None or slope.factor <= 0:
            return unknown
        rate = 1.0 / slope.factor
        near = round_rate((1.0 + EVIDENCE.near_rate) * rate)
        if not self._one_unit_of_angle() or abs(rate / near - 1.0) >= EVIDENCE.near_rate:
            return unknown
        why = "the recorded velocity is that often the step of the position from sample to sample"
        return near, Guess(f"{near:g} Hz", "likely", f"{why}, if both are in one unit of angle")

    def _one_unit_of_angle(self) -> bool:
        """Return whether a velocity without a clock is in the positions' unit.

        Both name it, or are called q and dq.
        """
        q, dq, tau = (c.group for c in (self.reading.q, self.reading.dq, self.reading.tau))
        if q is None or dq is None:
            return False
        position, speed = (self.named(group, self.reading.table)[0] for group in (q, dq))
        if position or speed:
            return speed == f"{position}/s"
        words = f"{q.words} {tau.words if tau else ''}".split()
        bare = {word.rstrip("0123456789") for word in words}
        return bool(_ONE_UNIT & bare) or bool(self.reading.message)

    def named(self, group: Group, table: RawTable) -> tuple[str | None, ...]:
        """Return the unit of each column by header and name, else by a line of the file."""
        units = []
        for j, own in enumerate(unit_of_group(group.columns, table)):
            linear = j < len(self.joints) and not self.joints[j].revolute
            said = None if own else self.statement(group, linear, table)
            units.append(own or (said.value or None if said else None))
        return tuple(units)

    def statement(self, group: Group, linear: bool, table: RawTable) -> Statement | None:
        """Return what the file states of a unit; counts are one where it states their size."""
        if group.quantity == "position" and self.counts is not None and not linear:
            return Statement("counts", self.counts.words)
        return stated_unit(table.notes, group.quantity, linear, group.motor)

    def position_units(self, group: Group) -> tuple[list[str], str, list[Guess]]:
        """Return the unit of each joint, further keys of the recipe, and the reasons."""
        assert self.q is not None
        table, dq = self.reading.table, self.reading.dq.group
        named, own = self.named(group, table), unit_of_group(group.columns, table)
        turning = [j for j in range(self.n) if not self.joints or self.joints[j].revolute]
        units, why, further = [""] * self.n, [], ""
        if turning:
            known = ((named[j], own[j]) for j in turning if named[j] is not None)
            first, own_first = next(known, (None, None))
            evidence = PositionEvidence(
                # It decides the unit of angle once that of time is known.
                self.slope if self.t is not None else None,
                [self.joints[j] for j in turning] if self.joints else (),
                group.side,
                self.fits,
                self.reading.message,
                self.named(dq, table)[min(turning[0], len(dq.columns) - 1)] if dq else None,
                self.counts.number if self.counts else None,
            )
            guess, further = position_unit(self.q[:, turning], first, evidence)
            for j in turning:
                units[j] = unit_of_joint(named[j], guess.value, first)
            why.append(_as_said(guess, own_first))
        for j in (j for j in range(self.n) if j not in turning):
            guess = slide_unit(self.q[:, j], named[j], self.joints[j])
            units[j] = guess.value
            why.append(_as_said(guess, own[j]))
        if shares := self.shares(own):
            units = ["" if j in shares else unit for j, unit in enumerate(units)]
            which = ", ".join(clean(group.columns[j], 40) for j in shares)
            near = f"{which}: up to {np.abs(self.q[:, shares]).max():.3g}, near 1 or 100"
            asked = "a gripper's opening or a share of a range, rather than a joint's angle?"
            why.append(Guess("", "unsure", f"{near}: {asked}"))
        return units, further, why

    def shares(self, own: Sequence[str | None]) -> list[int]:
        """Return the joints that move like a share of a range, of no robot and without a unit."""
        if self.q is None or self.joints:
            return []
        found = [j for j in range(self.n) if own[j] is None and is_share(self.q[:, j])]
        return found if len(found) < self.n else []

    def torque_unit(self, tau: Array, group: Group, named: str | None) -> Guess:
        """Return the unit of the torques, "" where columns, file or positions leave it open."""
        table, q = self.reading.torque_table, self.reading.q.group
        guess = torque_unit(tau, named, self.current, self.links, self.reading.message)
        peak = f"up to {np.abs(tau).max():.4g}"
        if group.words == WITHOUT_NAME and named is None:
            asked = "neither position nor velocity: a torque in N m, or a current in A?"
            return Guess("", "unsure", f"{peak}, {asked}")
        if guess.confidence == "sure":
            if self.noted_motor or (group.motor and not self.current and not self.followed):
                why = f"{guess.why}: at the joint, or on the motor's shaft?"
                return replace(guess, confidence="unsure", why=why)
            return _as_said(guess, unit_of_group(group.columns, table)[0])
        outside = q is not None and self.joints and "" in self.position_units(q)[0]
        if guess.value == "N m" and outside:  # of the limits
            asked = "N m of the joint, or of the motor's shaft, as the positions may be?"
            return Guess("", "unsure", f"{peak}: {asked}")
        if group.words == BY_FILE:
            file = clean(table.source, 60)
            asked = f"of a file named '{file}': a torque in N m, or a current in A?"
            return Guess("", "unsure", f"{peak}, {asked}")
        return guess

    def _fits(self) -> dict[str, LinkFit]:
        """Return how the torque follows from the links, for each unit the positions may be in."""
        q, robot, group = self.q, self.reading.arm.robot, self.reading.q.group
        if self.model is None or robot is None or group is None or q is None or self.tau is None:
            return {}
        t = self.reading.table.rows / self.rate if self.t is None else self.t
        turning = all(joint.revolute for joint in robot.joints)
        if not turning or self.tau.shape != q.shape or not np.median(np.diff(t)) > 0.0:
            return {}
        units = {unit: [unit] * self.n for unit in _ANGLES}
        sizes = {unit: known.factor for unit, known in UNITS.items()}
        if self.counts and self.counts.number > 0.0:
            sizes["counts"] = 2.0 * math.pi / self.counts.number
        if any(self.named(group, self.reading.table)):
            units[_NAMED] = self.position_units(group)[0]
            if not set(units[_NAMED]) <= sizes.keys():
                return {}
        factors = {key: np.array([sizes[unit] for unit in each]) for key, each in units.items()}
        return fits_by_unit(partial(self.model, robot), q, self.tau, t, factors)

    @cached_property
    def links(self) -> LinkFit | None:
        """Return the fit in the unit of the positions, where that is open the best.

        None where the links say nothing.
        """
        if not self.fits or self.reading.q.group is None:
            return None
        unit = self.position_units(self.reading.q.group)[0][0]
        fits = [fit for key, fit in self.fits.items() if key in (_NAMED, unit)]
        fits = fits or list(self.fits.values())
        fits = [fit for fit in fits if fit.followed] or [fit for fit in fits if fit.varies]
        best = min(fits, key=lambda fit: fit.left, default=None)
        return best if best is not None and best.varies else None

    def out_of_order(self, group: Group) -> bool:
        """Return whether the joints' order is open: foreign words, in no order from the base."""
        if group.order != "file" or len(group.columns) == 1 or self.reading.by_evidence:
            return group.order == "text"
        lower = [column.lower() for column in group.columns]
        parts = list(enumerate(_BASE_TO_TIP))
        ranks = [next((k for k, part in parts if part in name), -1) for name in lower]
        return -1 in ranks or ranks != sorted(ranks) or lower == sorted(lower)

    def doubt(self, signal: str, group: Group | None, other: Group | None) -> str | None:
        """Return why the columns of a signal are left open, "" without a reason; None otherwise.

        A word that the other signal's names have not may say more, unless a velocity or the robot's
        links confirm it.
        """
        links = self.links
        if group is None or self.out_of_order(group):
            return ""
        confirmed = links is not None and links.followed and not links.alone
        words = group.unknown - (other.unknown if other else frozenset())
        if words and not (signal == "tau" and confirmed):
            return f"what does '{clean(min(words), 40)}' say of it?"
        best = min(self.fits.values(), key=lambda fit: fit.left, default=None)
        for fit in (links, self.fits.get(_NAMED, best)):
            if fit is not None and fit.otherwise:
                return f"the robot's own links agree far better with {fit.otherwise}"
        if links is None:
            return None
        named = any(self.named(group, self.reading.torque_table))
        if not links.followed and (signal == "q" or not named):
            disagree = "torque and motion do not agree by the robot's own links"
            return f"{disagree}: other torques, or the order, unit or zero of the joints?"
        if links.alone and signal == "tau" and group.origin == "plain":
            asked = "without friction: computed, or simulated?"
            return f"it is what the robot's own links ask for, {asked}"
        return None

    @property
    def sign(self) -> Guess:
        """Return the sign of the torques by links and friction; no reason without positions."""
        if self.q is None or self.tau is None or self.q.shape != self.tau.shape:
            return Guess("as recorded", "unsure", "")
        followed = self.links is not None and self.links.followed
        return sign_of(self.q, self.tau, self.links.signs if self.links and followed else None)

    @property
    def of_motors(self) -> bool:
        """Return whether positions are the motors', by name, note or the start at quarter turns."""
        group = self.reading.q.group
        if group is None or self.q is None:
            return False
        open_unit = not self.position_units(group)[2][0].value
        if (open_unit and quarter_turns(self.q)) or self.noted_motor:
            return True
        return group.motor and "theta" not in group.words and not self.followed

    @property
    def followed(self) -> bool:
        """Return whether the robot's links confirm the joints' torque and motion, in size too."""
        group, links = self.reading.tau.group, self.links
        named = self.named(group, self.reading.torque_table)[0] if group else None
        unit = UNITS.get(named or "N m")
        if links is None or unit is None or not links.followed:
            return False
        return not unlike_links(links, unit.factor, named=False)

    @property
    def noted_motor(self) -> bool:
        """Return whether a line of the file names the motors or a gear, and no links deny it."""
        notes = self.reading.table.notes
        said = any(_MOTOR_SIDE.search(note) for note in notes)
        return not self.followed and (stated_gear(notes) is not None or said)


def _as_said(guess: Guess, own: str | None) -> Guess:
    """Return a guess that rests on a line of the file alone as no more than likely."""
    if guess.confidence != "sure" or own is not None:
        return guess
    why = guess.why.replace("named so", "a line of the file says so")
    return replace(guess, confidence="likely", why=why)


def unit_of_joint(named: str | None, guessed: str, first: str | None) -> str:
    """Return the unit of one of several columns, "" where only others state one."""
    if not guessed or (named is None and first is not None):
        return ""
    unit = guessed if named is None else named
    return unit if unit in UNITS or unit == "counts" else ""
