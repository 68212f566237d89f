"""Weigh what a recording says of its clock, positions and torques: names, lines of the file, numbers, the robot's links.

Each finding is a value with its confidence and reasons; where these contradict each other, or say nothing,
the value is "" and a person is asked. `guess` writes them down as a recipe.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from pipelines.errors import clean
from pipelines.log.experiment import Array
from pipelines.log.recording.clock_guess import SECONDS, clock_as_stated, rate_as_stated, round_rate
from pipelines.log.recording.column_groups import Group, unit_of_group
from pipelines.log.recording.evidence import (
    Guess,
    Slope,
    position_unit,
    quarter_turns,
    sign_of,
    slide_unit,
    torque_unit,
)
from pipelines.log.recording.link_evidence import LinkFit, fits_by_unit, unlike_links
from pipelines.log.recording.raw import RawTable
from pipelines.log.recording.reading import BY_FILE, WITHOUT_NAME, Reading, matrix
from pipelines.log.recording.stated import (
    Statement,
    stated_counts,
    stated_gear,
    stated_rate,
    stated_unit,
)
from pipelines.log.robot import Joint, RobotDescription
from pipelines.log.units import UNITS

__all__ = ["Inference", "Model", "unit_of_joint", "whole"]

_BASE_TO_TIP = (
    "base",
    "torso",
    "waist",
    "shoulder",
    "elbow",
    "forearm",
    "wrist",
    "hand",
)  # parts of an arm
_ONE_UNIT = frozenset(
    {"q", "qpos", "jpos", "effort", "efforts"}
)  # mechanics, ROS: velocities in the positions' unit of angle
_SHARE = 0.02  # of a bound: a number that keeps 0..1, and comes near both, is a share of an opening or of a range
_ANGLES, _NAMED = (
    ("rad", "deg", "rev"),
    "as named",
)  # what the torque is tried with; and what names or lines say
_MOTOR_SIDE = re.compile(
    r"(motor|rotor|drive)[ _-]*(side|shaft|seit)|before the gear", re.IGNORECASE
)

Model = Callable[[RobotDescription, Array, Array, Array], Array | None]


class Inference:
    """What is known of one recording. Not frozen: later findings rest on earlier ones."""

    def __init__(self, reading: Reading, model: Model | None) -> None:
        self.reading, self.model = reading, model
        q, tau = reading.q.group, reading.tau.group
        self.q = matrix(reading.table, q.columns) if q else None
        self.tau = matrix(reading.torque_table, tau.columns) if tau else None
        self.n = reading.joints
        arm = reading.arm.robot
        self.joints: tuple[Joint, ...] = arm.joints if arm is not None else ()
        self.clock_unit, self.clock_guess = "", Guess("", "unsure", "")
        self.t: Array | None = None  # [s]
        self.stated, self.counts = (
            stated_rate(reading.table.notes),
            stated_counts(reading.table.notes),
        )
        self.slope = (
            reading.slope if reading.clock is None else None
        )  # of q against dq, per second (or sample)
        self.rate, self.rate_guess = rate_as_stated(self.stated, self.slope)
        if reading.clock is not None:
            clock = reading.clock
            self.clock_unit, self.clock_guess = clock_as_stated(
                clock, self.q, reading.slope, reading.table.notes, self.stated
            )
            factor = 1.0 if clock.paired else SECONDS.get(self.clock_unit)
            factor = 1.0 / self.rate if self.clock_unit == "sample" and self.rate > 0.0 else factor
            if factor is not None:
                self.t = clock.values * factor
                self.slope = reading.slope and Slope(
                    reading.slope.factor / factor, reading.slope.correlation
                )
        elif not math.isfinite(self.rate) and self.stated is None:
            self.rate, self.rate_guess = self._rate_of_velocity()
        self.current = tau is not None and tau.quantity == "current"
        self.fits: dict[str, LinkFit] = {}  # by the unit of the positions
        self.fits = self._fits()
        self.links = self._links()

    def _rate_of_velocity(self) -> tuple[float, Guess]:
        """Return the rate [Hz] that a recorded velocity shows; nan where none does, or no round one, as recorders are set to."""
        slope = self.reading.slope if self._one_unit_of_angle() else None
        rate = 1.0 / slope.factor if slope is not None and slope.factor > 0 else math.nan
        near = round_rate(1.005 * rate) if math.isfinite(rate) else math.nan
        guess = Guess(
            f"{near:g} Hz",
            "likely",
            "the recorded velocity is that often the step of the position from sample to "
            "sample, if both are in one unit of angle",
        )
        return (
            (near, guess) if abs(rate / near - 1.0) < 5e-3 else (math.nan, Guess("", "unsure", ""))
        )

    def _one_unit_of_angle(self) -> bool:
        """Tell whether a velocity without a clock is in the positions' unit: both name it, or are called q and dq."""
        q, dq = self.reading.q.group, self.reading.dq.group
        if q is None or dq is None:
            return False
        position, speed = (self.named(group, self.reading.table)[0] for group in (q, dq))
        words = q.words.split() + (
            self.reading.tau.group.words.split() if self.reading.tau.group else []
        )
        named = bool(_ONE_UNIT & {word.rstrip("0123456789") for word in words}) or bool(
            self.reading.message
        )
        return speed == f"{position}/s" if position or speed else named

    def named(self, group: Group, table: RawTable) -> tuple[str | None, ...]:
        """Return the unit of each column by header and name, else as a line of the file states it; None where none does."""
        stated = [
            self.statement(
                group.quantity,
                bool(j < len(self.joints) and not self.joints[j].revolute),
                group.motor,
                table,
            )
            for j in range(len(group.columns))
        ]
        return tuple(
            unit or (said.value or None if said else None)
            for unit, said in zip(unit_of_group(group.columns, table), stated, strict=True)
        )

    def statement(
        self, quantity: str, linear: bool, motor: bool, table: RawTable
    ) -> Statement | None:
        """Return what the file states of a unit; raw counts go by the size that it states of one."""
        if quantity == "position" and self.counts is not None and not linear:
            return Statement("counts", self.counts.words)
        return stated_unit(table.notes, quantity, linear, motor)

    def position_units(self, group: Group) -> tuple[list[str], str, list[Guess]]:
        """Return the unit of each joint, further keys of the recipe, and the reasons."""
        assert self.q is not None
        named, own = (
            self.named(group, self.reading.table),
            unit_of_group(group.columns, self.reading.table),
        )
        speed = (
            self.named(self.reading.dq.group, self.reading.table)[0]
            if self.reading.dq.group
            else None
        )
        turning = [j for j in range(self.n) if not self.joints or self.joints[j].revolute]
        units, why, further = [""] * self.n, [], ""
        if turning:
            slope = (
                self.slope if self.t is not None else None
            )  # decides the unit of angle once that of time is known
            joints = [self.joints[j] for j in turning] if self.joints else ()
            first = next((named[j] for j in turning if named[j] is not None), None)
            own_first = next((own[j] for j in turning if named[j] is not None), None)
            guess, further = position_unit(
                self.q[:, turning],
                slope,
                first,
                joints,
                group.side,
                self.fits,
                self.reading.message,
                speed,
                self._counts_of_turn,
            )
            for j in turning:
                units[j] = unit_of_joint(named[j], guess.value, first)
            why.append(_as_said(guess, own_first))
        for j in (j for j in range(self.n) if j not in turning):
            guess = slide_unit(self.q[:, j], named[j], self.joints[j])
            units[j] = guess.value
            why.append(_as_said(guess, own[j]))
        shares = self.shares(own)
        if shares:
            units = ["" if j in shares else unit for j, unit in enumerate(units)]
            which = ", ".join(clean(group.columns[j], 40) for j in shares)
            why.append(
                Guess(
                    "",
                    "unsure",
                    f"{which}: up to {np.abs(self.q[:, shares]).max():.3g}, near 1 or 100: a gripper's "
                    "opening or a share of a range, rather than a joint's angle?",
                )
            )
        return units, further, why

    @property
    def at_turns(self) -> bool:
        """Tell whether positions of no unit start at quarter turns of motors."""
        group = self.reading.q.group
        return (
            group is not None
            and self.q is not None
            and (not self.position_units(group)[2][0].value and bool(quarter_turns(self.q)))
        )

    @property
    def _counts_of_turn(self) -> float:
        """Return the counts of a turn that the file states; nan where it states none, 0 where it states several numbers."""
        return (
            math.nan
            if self.counts is None
            else self.counts.number
            if math.isfinite(self.counts.number)
            else 0.0
        )

    def shares(self, own: Sequence[str | None]) -> list[int]:
        """Return the joints, without a robot that has them or a unit of their own, that move like a share of a range."""
        found = [
            j
            for j in range(self.n)
            if self.q is not None and not self.joints and own[j] is None and _is_share(self.q[:, j])
        ]
        return found if len(found) < self.n else []

    def torque_unit(self, tau: Array, group: Group, named: str | None) -> Guess:
        """Return the unit of the torques, "" where columns, file or positions leave it open."""
        return _as_said(
            self._torque_unit(tau, group, named),
            unit_of_group(group.columns, self.reading.torque_table)[0],
        )

    def _torque_unit(self, tau: Array, group: Group, named: str | None) -> Guess:
        q = self.reading.q.group
        guess, peak = (
            torque_unit(tau, named, self.current, self.links, self.reading.message),
            f"up to {np.abs(tau).max():.4g}",
        )
        if group.words == WITHOUT_NAME and named is None:
            message = f"{peak}, neither position nor velocity: a torque in N m, or a current in A?"
            return Guess("", "unsure", message)
        if guess.confidence == "sure":
            if self.noted_motor or (group.motor and not self.current and not self.followed):
                return replace(
                    guess,
                    confidence="unsure",
                    why=f"{guess.why}: at the joint, or on the motor's shaft?",
                )
            return guess
        if (
            guess.value == "N m"
            and self.joints
            and q is not None
            and "" in self.position_units(q)[0]
        ):  # outside their limits
            message = f"{peak}: N m of the joint, or of the motor's shaft, as the positions may be?"
            return Guess("", "unsure", message)
        if group.words == BY_FILE:
            file = clean(self.reading.torque_table.source, 60)
            message = f"{peak}, of a file named '{file}': a torque in N m, or a current in A?"
            return Guess("", "unsure", message)
        return guess

    def _fits(self) -> dict[str, LinkFit]:
        """Return how the torque follows from the motion by the robot's links, for each unit the positions may be in."""
        q, robot, group = self.q, self.reading.arm.robot, self.reading.q.group
        if self.model is None or robot is None or group is None or q is None or self.tau is None:
            return {}
        t = self.reading.table.rows / self.rate if self.t is None else self.t
        turning = all(joint.revolute for joint in robot.joints)
        if not turning or self.tau.shape != q.shape or not np.median(np.diff(t)) > 0.0:
            return {}
        named = self.position_units(group)[0]
        units = {unit: [unit] * self.n for unit in _ANGLES}
        sizes = {unit: known.factor for unit, known in UNITS.items()}
        if self._counts_of_turn > 0.0:
            sizes["counts"] = 2.0 * math.pi / self._counts_of_turn
        if any(self.named(group, self.reading.table)):
            if not set(named) <= sizes.keys():
                return {}
            units |= {_NAMED: named}
        factors = {key: np.array([sizes[unit] for unit in each]) for key, each in units.items()}
        return fits_by_unit(partial(self.model, robot), q, self.tau, t, factors)

    def _links(self) -> LinkFit | None:
        """Return the fit by links in the unit of the positions, where that is open the best; None where the links say nothing."""
        if not self.fits or self.reading.q.group is None:
            return None
        unit = self.position_units(self.reading.q.group)[0][0]
        fits = [fit for key, fit in self.fits.items() if key in (_NAMED, unit)] or list(
            self.fits.values()
        )
        fits = [fit for fit in fits if fit.followed] or [fit for fit in fits if fit.varies]
        best = min(fits, key=lambda fit: fit.left, default=None)
        return best if best is not None and best.varies else None

    def out_of_order(self, group: Group) -> bool:
        """Tell whether the order of the joints is open: words that are not the robot's, in no order from base to tip."""
        if group.order != "file" or len(group.columns) < 2 or self.reading.by_evidence:
            return group.order == "text"
        lower = [column.lower() for column in group.columns]
        ranks = [
            next((k for k, part in enumerate(_BASE_TO_TIP) if part in name), -1) for name in lower
        ]
        return -1 in ranks or ranks != sorted(ranks) or lower == sorted(lower)

    def doubt(self, signal: str, group: Group | None, other: Group | None) -> str | None:
        """Return why the columns of a signal are left open, "" without a reason; None where they are not.

        A word that the other signal's names have not may say more, unless a velocity or the robot's links confirm it.
        """
        links = self.links
        if group is None or self.out_of_order(group):
            return ""
        confirmed = links is not None and links.followed and not links.alone
        words = group.unknown - (other.unknown if other else frozenset())
        if words and not (signal == "tau" and confirmed):
            return f"what does '{clean(min(words), 40)}' say of it?"
        named = any(self.named(group, self.reading.torque_table))
        best = self.fits.get(_NAMED) or min(
            self.fits.values(), key=lambda fit: fit.left, default=None
        )
        if otherwise := next(
            (fit.otherwise for fit in (links, best) if fit is not None and fit.otherwise), ""
        ):
            return f"the robot's own links agree far better with {otherwise}"
        if links is not None and not links.followed and (signal == "q" or not named):
            return (
                "torque and motion do not agree by the robot's own links: "
                "other torques, or the order, unit or zero of the joints?"
            )
        if links is not None and links.alone and signal == "tau" and group.origin == "plain":
            return "it is what the robot's own links ask for, without friction: computed, or simulated?"
        return None

    @property
    def sign(self) -> Guess:
        """Return the sign of the torques by links and friction, without a reason where no positions are beside them."""
        if self.q is None or self.tau is None or self.q.shape != self.tau.shape:
            return Guess("as recorded", "unsure", "")
        return sign_of(
            self.q,
            self.tau,
            self.links.signs if self.links is not None and self.links.followed else None,
        )

    @property
    def of_motors(self) -> bool:
        """Tell whether positions are the motors' by name or note, or start as a motor's do."""
        group = self.reading.q.group
        named = (
            group is not None and group.motor and "theta" not in group.words and not self.followed
        )
        return group is not None and (self.at_turns or self.noted_motor or named)

    @property
    def followed(self) -> bool:
        """Tell whether the robot's links confirm torque and motion as those of the joints, in size as well."""
        group = self.reading.tau.group
        named = self.named(group, self.reading.torque_table)[0] if group else None
        unit, links = UNITS.get(named or "N m"), self.links
        return (
            links is not None
            and unit is not None
            and links.followed
            and not unlike_links(links, unit.factor, named=False)
        )

    @property
    def noted_motor(self) -> bool:
        """Tell whether a line of the file says that its numbers are the motors', or names a gear, and no links deny it."""
        notes = self.reading.table.notes
        return not self.followed and (
            stated_gear(notes) is not None or any(_MOTOR_SIDE.search(note) for note in notes)
        )


def _as_said(guess: Guess, own: str | None) -> Guess:
    """Return a guess that rests on a line of the file, and not on the column's `own` name or header, as no more than likely."""
    said = guess.confidence == "sure" and own is None
    return (
        replace(
            guess,
            confidence="likely",
            why=guess.why.replace("named so", "a line of the file says so"),
        )
        if said
        else guess
    )


def whole(values: Array) -> bool:
    return bool((values == np.round(values)).mean() > 0.99)


def unit_of_joint(named: str | None, guessed: str, first: str | None) -> str:
    """Return the unit of one of several columns: its own, or what was guessed of all; "" where only others state one."""
    if not guessed or (named is None and first is not None):
        return ""
    unit = guessed if named is None else named
    return unit if unit in UNITS or unit == "counts" else ""


def _is_share(values: Array) -> bool:
    """Tell whether numbers keep 0..1, 0..100 or these and their negatives, and reach the upper end, as a joint hardly does."""
    low, high = float(values.min()), float(values.max())
    full = 1.0 if max(high, -low) <= 1.0 + _SHARE else 100.0
    near = (1.0 - _SHARE) * full <= high <= (1.0 + _SHARE) * full
    return near and (
        -_SHARE * full <= low < 0.3 * full or -(1.0 + _SHARE) * full <= low < -0.7 * full
    )
