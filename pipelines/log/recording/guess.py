"""Draft a recipe for a recording, with the evidence for every guess, for a person to correct.

The draft says what each value rests on: a name, a limit of the robot beside the recording, the
agreement of a velocity with the slope of a position, jumps of one size, the sign of the power. What
neither names nor numbers decide is marked FILL IN, with the candidates; what is only likely is
marked "check:".
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from pipelines.errors import InputRejected, clean
from pipelines.log.experiment import Array
from pipelines.log.recording.clock_guess import SECONDS, clock_as_stated, rate_as_stated, round_rate
from pipelines.log.recording.column_roles import Choice, Group, texts_of, unit_of_group
from pipelines.log.recording.evidence import (
    Guess,
    Slope,
    held,
    position_unit,
    quarter_turns,
    sign_of,
    slide_unit,
    torque_unit,
    velocity_unit,
)
from pipelines.log.recording.link_evidence import LinkFit, fits_by_unit, unlike_links
from pipelines.log.recording.raw import RawTable
from pipelines.log.recording.reading import (
    BY_FILE,
    WITHOUT_NAME,
    Reading,
    arm_beside,
    companion_for,
    matrix,
    read_recording,
    with_companion,
)
from pipelines.log.recording.recipe_reader import BLANK
from pipelines.log.recording.sound import lost_numbers, sound_samples
from pipelines.log.recording.sources import read_table
from pipelines.log.recording.stated import Statement, stated_counts, stated_gear, stated_rate, stated_scale, stated_unit
from pipelines.log.robot import Joint, RobotDescription
from pipelines.log.units import UNITS

__all__ = ["Draft", "guess_recipe"]

_MOST_COLUMNS = 2000
_BASE_TO_TIP = ("base", "torso", "waist", "shoulder", "elbow", "forearm", "wrist", "hand")  # parts of an arm
_ONE_UNIT = frozenset({"q", "qpos", "jpos", "effort", "efforts"})  # mechanics, ROS: velocities in the positions' unit of angle
_SHARE = 0.02  # of a bound: a number that keeps 0..1, and comes near both, is a share of an opening or of a range
_ANGLES, _NAMED = ("rad", "deg", "rev"), "as named"  # what positions may be in where no unit is named; else that
_MOTOR_SIDE = re.compile(r"(motor|rotor|drive)[ _-]*(side|shaft|seit)|before the gear", re.IGNORECASE)
_ONE_JOINT = """[robot]                                 # check: one joint, about the z axis
name = "one-joint"
# gravity: [0.0, 0.0, -9.81] on a vertical axis, where it does no work; [0.0, -9.81, 0.0] on a horizontal one
gravity = "FILL IN"

[robot.kinematics]
convention = "dh"

[[robot.joint]]
name = "joint"
type = "revolute"
a = 0.0
alpha = 0.0
d = 0.0
offset = 0.0
"""


@dataclass(frozen=True)
class Draft:
    """A recipe to be checked by a person, and what it rests on."""

    text: str
    evidence: tuple[str, ...]
    blanks: tuple[str, ...]  # what must be filled in before it runs


Model = Callable[[RobotDescription, Array, Array, Array], Array | None]


def guess_recipe(path: Path, robot: str | None = None, model: Model | None = None) -> Draft:
    """Return a commented recipe for the recording in `path`; companion files and the robot in its folder are used.

    Args:
        robot: description to use instead of the one beside the recording.
        model: the torques (samples, joints) [N m] of a robot at q, dq, ddq [rad], None where its links are unknown.

    Raises:
        InputRejected: the file cannot be read as a table of numbers.
    """
    table = read_table(path)
    if len(table.columns) > _MOST_COLUMNS:
        raise InputRejected("F16", f"{len(table.columns)} columns: too many to guess what each is", where=path,
                            remedy="export the joints' signals alone, or write the recipe")
    lost = lost_numbers(table)
    table = sound_samples(table, lost)
    reading = read_recording(path, table, arm_beside(path.parent, robot))
    companion = companion_for(reading)
    if companion is not None:
        companion = sound_samples(companion, lost)
        reading = with_companion(reading, companion if np.array_equal(companion.rows, table.rows) else None)
    return _Drafting(reading, lost, model).draft()


class _Drafting:
    """Collects the lines of a draft. Not frozen: it is the pencil, the `Draft` is the result."""

    def __init__(self, reading: Reading, lost: Sequence[float], model: Model | None) -> None:
        self.reading = reading
        self.lost, self.model = lost, model
        self.evidence: list[str] = []
        self.blanks: list[str] = []
        q, tau = reading.q.group, reading.tau.group
        self.q = matrix(reading.table, q.columns) if q else None
        self.tau = matrix(reading.torque_table, tau.columns) if tau else None
        self.n = reading.joints
        arm = reading.arm.robot
        self.joints: tuple[Joint, ...] = arm.joints if arm is not None else ()
        self.clock_unit, self.clock_guess = "", Guess("", "unsure", "")
        self.t: Array | None = None  # [s]
        self.stated, self.counts = stated_rate(reading.table.notes), stated_counts(reading.table.notes)
        self.slope = reading.slope if reading.clock is None else None  # of q against dq, per second (or sample)
        self.rate, self.rate_guess = rate_as_stated(self.stated, self.slope)
        if reading.clock is not None:
            clock = reading.clock
            self.clock_unit, self.clock_guess = clock_as_stated(clock, self.q, reading.slope, reading.table.notes, self.stated)
            factor = 1.0 if clock.paired else SECONDS.get(self.clock_unit)
            factor = 1.0 / self.rate if self.clock_unit == "sample" and self.rate > 0.0 else factor
            if factor is not None:
                self.t = clock.values * factor
                self.slope = reading.slope and Slope(reading.slope.factor / factor, reading.slope.correlation)
        elif not math.isfinite(self.rate) and self.stated is None:
            self.rate, self.rate_guess = self._rate_of_velocity()
        self.current = tau is not None and tau.quantity == "current"
        self.at_turns = False  # positions of no unit start at quarter turns of motors
        self.fits: dict[str, LinkFit] = {}  # by the unit of the positions
        self.fits = self._fits()
        self.links = self._links()

    def note(self, what: str, guess: Guess) -> str:
        """Return the comment behind a guessed value: confidence, evidence, and what to check."""
        why = clean(guess.why, 300)
        self.evidence.append(f"{what}: {guess.value or 'open'} ({guess.confidence}: {why})")
        return f"# {'check: ' if guess.confidence != 'sure' else ''}{guess.confidence}, {why}"

    def blank(self, what: str) -> str:
        self.blanks.append(what)
        return BLANK

    def draft(self) -> Draft:
        table = self.reading.table
        name = clean(self.reading.path.name, 80)
        columns = ", ".join(clean(c, 40) for c in table.columns)
        lines = [f"# Drafted by `rrrid import --guess {name}`: {table.rows.size} samples, columns {columns}."]
        lines += [f"# {clean(check.message, 200)}." for check in table.checks if check.level != "ok"]
        lines += [f"# Go through every \"check:\" and fill in what says {BLANK}; then: rrrid import RECIPE.toml --source FOLDER",
                  ""]
        lines += [*self._robot(), *self._log(), *self._time(), "[signals]", *self._position(), *self._velocity(),
                  *self._torque(), "", *self._drive(), *self._missing(), *self._resample()]
        return Draft("\n".join(lines) + "\n", tuple(self.evidence), tuple(self.blanks))

    def _robot(self) -> list[str]:
        arm = self.reading.arm
        if len(arm.files) == 1:
            why = "as --robot says" if arm.named else "check: likely, the robot beside the recording"
            lines = ["[robot]", f"use = {_quoted(arm.files[0])}   # {why}"]
            if arm.problem:
                self.evidence.append(f"robot: {clean(arm.problem, 300)}")
                lines.append(f"# {clean(arm.problem, 300)}")
                if "tip_link" in arm.problem:
                    lines.append(f'tip_link = "{self.blank("robot.tip_link")}"')
            return [*lines, ""]
        known = self.reading.q.group or self.reading.tau.group
        if not arm.files and known and self.n == 1 and not self.reading.sisters:
            self.blanks.append("robot.gravity")
            return _ONE_JOINT.split("\n")
        which = "robot.toml, a URDF, or a shipped name"
        if arm.files:
            which = f"one of {', '.join(clean(file, 40) for file in arm.files)}"
        joints = f" of {self.n} joints" if known and self.n > 1 else ""
        return ["[robot]", f'use = "{self.blank("robot.use")}"   # the robot{joints}: {which}', *self._sister_lines(), ""]

    def _log(self) -> list[str]:
        name = _quoted(self.reading.path.name)
        return ["[log]", f"match = {name}      # a pattern such as \"run_{{number}}.csv\" takes many files",
                'experiment = "free"                     # check: friction | excitation | writing | frf | hold | free',
                'role = "identify"                       # check: identify | validate | reference',
                self._held(), ""]

    def _held(self) -> str:
        """Return `torque = …`: by the name of its columns, else by whether it is held over samples."""
        group = self.reading.tau.group
        if group is None:
            guess = Guess("measured", "unsure", 'the torque is open; "held-command" where the drive was commanded')
        elif group.origin == "commanded":
            guess = Guess("held-command", "likely", f"column '{clean(group.columns[0], 40)}' is named a command")
        elif self.current:
            guess = Guess("measured", "likely", "a current is sampled like the position")
        elif group.origin == "measured":
            guess = Guess("measured", "sure", f"column '{clean(group.columns[0], 40)}' is named a measurement")
        else:
            assert self.tau is not None
            guess = held(self.tau, self.q if self.q is not None else self.tau)
        return f'torque = "{guess.value}"   {self.note("torque", guess)}'

    def _time(self) -> list[str]:
        clock = self.reading.clock
        if clock is None:
            return self._rate()
        if clock.paired:
            return ["[time]", f"column = [{', '.join(map(_quoted, clock.columns))}]",
                    f'unit = ["{clock.units[0]}", "{clock.units[1]}"]   {self.note("time unit", self.clock_guess)}', ""]
        lines = ["[time]", f"column = {_quoted(clock.columns[0])}"]
        unit = self.clock_unit or self.blank("time.unit")
        lines.append(f'unit = "{unit}"   {self.note("time unit", self.clock_guess)}')
        if self.clock_unit == "sample" and math.isfinite(self.rate):
            lines.append(f"rate = {self.rate:g}   {self.note('rate', self.rate_guess)}")
        elif self.clock_unit == "sample":
            lines.append(f'rate = "{self.blank("time.rate")}"   # Hz')
        return [*lines, ""]

    def _rate(self) -> list[str]:
        """Return [time] without a column: the rate that the file states, or a recorded velocity shows."""
        if math.isfinite(self.rate):
            return ["[time]", f"rate = {self.rate:g}   {self.note('rate', self.rate_guess)}", ""]
        self.evidence.append("rate: no column of time")
        self.blanks.append("time.rate")
        why = self.rate_guess.why or "no column rises steadily, so only you know it"
        return ["[time]", f'rate = "{BLANK}"                        # Hz; {clean(why, 200)}', *self._map_hint(), ""]

    def _rate_of_velocity(self) -> tuple[float, Guess]:
        """Return the rate [Hz] that a recorded velocity shows; nan where none does, or no round one, as recorders are set to."""
        slope = self.reading.slope if self._one_unit_of_angle() else None
        rate = 1.0 / slope.factor if slope is not None and slope.factor > 0 else math.nan
        near = round_rate(1.005 * rate) if math.isfinite(rate) else math.nan
        guess = Guess(f"{near:g} Hz", "likely", "the recorded velocity is that often the step of the position from sample to "
                      "sample, if both are in one unit of angle")
        return (near, guess) if abs(rate / near - 1.0) < 5e-3 else (math.nan, Guess("", "unsure", ""))

    def _one_unit_of_angle(self) -> bool:
        """Tell whether a velocity without a clock is in the positions' unit: both name it, or are called q and dq."""
        q, dq = self.reading.q.group, self.reading.dq.group
        if q is None or dq is None:
            return False
        position, speed = (self._named(group, self.reading.table)[0] for group in (q, dq))
        words = q.words.split() + (self.reading.tau.group.words.split() if self.reading.tau.group else [])
        named = bool(_ONE_UNIT & {word.rstrip("0123456789") for word in words}) or bool(self.reading.message)
        return speed == f"{position}/s" if position or speed else named

    def _named(self, group: Group, table: RawTable) -> tuple[str | None, ...]:
        """Return the unit of each column by header and name, else as a line of the file states it; None where none does."""
        stated = [self._statement(group.quantity, bool(j < len(self.joints) and not self.joints[j].revolute), group.motor, table)
                  for j in range(len(group.columns))]
        return tuple(unit or (said.value or None if said else None)
                     for unit, said in zip(unit_of_group(group.columns, table), stated, strict=True))

    def _statement(self, quantity: str, linear: bool, motor: bool, table: RawTable) -> Statement | None:
        """Return what the file states of a unit; raw counts go by the size that it states of one."""
        if quantity == "position" and self.counts is not None and not linear:
            return Statement("counts", self.counts.words)
        return stated_unit(table.notes, quantity, linear, motor)

    def _map_hint(self) -> list[str]:
        """Positions that rise in even steps without a clock are a map rather than a motion."""
        group = self.reading.q.group
        steps = np.diff(self.q[:, 0]) if self.q is not None and self.q.shape[1] == 1 else np.zeros(0)
        even = (steps > 0).all() or (steps < 0).all()
        if group is None or steps.size < 10 or not even or np.std(steps) > 0.2 * abs(np.mean(steps)):
            return []
        self.evidence.append("positions rise in even steps without a clock: a map")
        name, file = clean(group.columns[0], 40), _quoted(self.reading.path.name)
        return [f"# check: likely a map and no log, {name} goes on in even steps of {np.mean(steps):.4g};",
                "#     then delete [log], [time] and [signals], and write",
                f"#     [[table]] match = {file}, columns = {{ position = {{ column = …, unit = … }}, … }}"]

    def _position(self) -> list[str]:
        choice = self.reading.q
        doubt = self._doubt("q", choice.group, self.reading.tau.group)
        if choice.group is None or self.q is None or doubt is not None:
            return self._open("q", choice, doubt)
        units, further, why = self._position_units(choice.group)
        if BLANK in further:
            self.blanks.append("signals.q.counts_per_rev")
        lines = [f"q = {{ {_columns(choice.group.columns, self.reading.table)}, unit = {self._units('q', units)}{further} }}"]
        lines += [f"    {self.note('q unit', guess)}" for guess in why]
        lines += self._as_stated(choice.group, self.reading.table)
        lines += [f"    {comment}" for comment in self._order(choice.group)]
        if still := [str(j + 1) for j in np.flatnonzero(np.ptp(self.q, axis=0) == 0.0)]:
            lines.append(f"    # joint {', '.join(still)} never moves in this file")
        return [*lines, *_also(choice, self.reading.table)]

    def _position_units(self, group: Group) -> tuple[list[str], str, list[Guess]]:
        """Return the unit of each joint, further keys of the recipe, and the reasons."""
        assert self.q is not None
        named = self._named(group, self.reading.table)
        speed = self._named(self.reading.dq.group, self.reading.table)[0] if self.reading.dq.group else None
        turning = [j for j in range(self.n) if not self.joints or self.joints[j].revolute]
        units, why, further = [""] * self.n, [], ""
        if turning:
            slope = self.slope if self.t is not None else None  # decides the unit of angle once that of time is known
            joints = [self.joints[j] for j in turning] if self.joints else ()
            first = next((named[j] for j in turning if named[j] is not None), None)
            guess, further = position_unit(self.q[:, turning], slope, first, joints, group.side, self.fits, self.reading.message,
                                           speed, self._counts_of_turn)
            for j in turning:
                units[j] = _unit_of_joint(named[j], guess.value, first)
            why.append(guess)
            self.at_turns = not guess.value and bool(quarter_turns(self.q))
        for j in (j for j in range(self.n) if j not in turning):
            guess = slide_unit(self.q[:, j], named[j], self.joints[j])
            units[j] = guess.value
            why.append(guess)
        own = unit_of_group(group.columns, self.reading.table)
        shares = self._shares(own)
        if shares:
            units = ["" if j in shares else unit for j, unit in enumerate(units)]
            which = ", ".join(clean(group.columns[j], 40) for j in shares)
            why.append(Guess("", "unsure", f"{which}: up to {np.abs(self.q[:, shares]).max():.3g}, near 1 or 100: a gripper's "
                             "opening or a share of a range, rather than a joint's angle?"))
        return units, further, why

    @property
    def _counts_of_turn(self) -> float:
        """Return the counts of a turn that the file states; nan where it states none, 0 where it states several numbers."""
        return math.nan if self.counts is None else self.counts.number if math.isfinite(self.counts.number) else 0.0

    def _shares(self, own: Sequence[str | None]) -> list[int]:
        """Return the joints, without a robot that has them or a unit of their own, that move like a share of a range."""
        found = [j for j in range(self.n) if self.q is not None and not self.joints and own[j] is None and _is_share(self.q[:, j])]
        return found if len(found) < self.n else []

    def _as_stated(self, group: Group, table: RawTable) -> list[str]:
        """Return a comment with the words of the file that a unit was taken from, or that contradict each other."""
        said = self._statement(group.quantity, False, group.motor, table)
        if said is None or None not in unit_of_group(group.columns, table):
            return []
        self.evidence.append(f"{group.quantity}: the file states {clean(said.words, 200)}")
        return [f"    # check: {'' if said.value else 'contradictory, '}the file states {clean(said.words, 200)}"]

    def _units(self, signal: str, units: Sequence[str]) -> str:
        """Return the unit in TOML: one text, or one a joint where they differ; FILL IN where one is open."""
        if "" in units:
            self.blanks.append(f"signals.{signal}.unit")
        words = [unit or BLANK for unit in units]
        return f'"{words[0]}"' if len(set(words)) == 1 else f"[{', '.join(map(_quoted, words))}]"

    def _out_of_order(self, group: Group) -> bool:
        """Tell whether the order of the joints is open: words that are not the robot's, in no order from base to tip."""
        if group.order != "file" or len(group.columns) < 2 or self.reading.by_evidence:
            return group.order == "text"
        lower = [column.lower() for column in group.columns]
        ranks = [next((k for k, part in enumerate(_BASE_TO_TIP) if part in name), -1) for name in lower]
        return -1 in ranks or ranks != sorted(ranks) or lower == sorted(lower)

    def _order(self, group: Group) -> list[str]:
        if group.order == "robot":
            return ["# in the order of the robot's joints, by their names"]
        if group.order == "file" and len(group.columns) > 1:
            return ["# check: the joints are taken in the order of the file, from the base to the tip"]
        return []

    def _velocity(self) -> list[str]:
        """Return the line of a recorded velocity that is the slope of the position; nothing where none is."""
        group, slope = self.reading.dq.group, self.slope
        if group is None or slope is None or self.t is None or self.q is None or not self.reading.q.group:
            return []
        position = self.reading.q.group
        if any(joint.type != "revolute" for joint in self.joints) or self._out_of_order(group) or (
                position.order != group.order or self._doubt("q", position, self.reading.tau.group) is not None):
            return []
        named = self._named(group, self.reading.table)[0]
        unit = velocity_unit(slope, self._position_units(self.reading.q.group)[0][0])
        if not unit or UNITS.get(named or unit) != UNITS[unit]:
            return []
        guess = Guess(unit, "likely",
                      f"the position's slope is {slope.factor:.4g} times it; remove the line where it was not measured")
        columns = _columns(group.columns, self.reading.table)
        return [f"dq = {{ {columns}, unit = {_quoted(unit)} }}", f"    {self.note('dq unit', guess)}"]

    def _doubt(self, signal: str, group: Group | None, other: Group | None) -> str | None:
        """Return why the columns of a signal are left open, "" without a reason; None where they are not.

        A word that the other signal's names have not may say more, unless a velocity or the robot's links confirm it.
        """
        links = self.links
        if group is None or self._out_of_order(group):
            return ""
        confirmed = links is not None and links.followed and not links.alone
        words = group.unknown - (other.unknown if other else frozenset())
        if words and not (signal == "tau" and confirmed):
            return f"what does '{clean(min(words), 40)}' say of it?"
        named = any(self._named(group, self.reading.torque_table))
        best = self.fits.get(_NAMED) or min(self.fits.values(), key=lambda fit: fit.left, default=None)
        if otherwise := next((fit.otherwise for fit in (links, best) if fit is not None and fit.otherwise), ""):
            return f"the robot's own links agree far better with {otherwise}"
        if links is not None and not links.followed and (signal == "q" or not named):
            return ("torque and motion do not agree by the robot's own links: "
                    "other torques, or the order, unit or zero of the joints?")
        if links is not None and links.alone and signal == "tau" and group.origin == "plain":
            return "it is what the robot's own links ask for, without friction: computed, or simulated?"
        return None

    def _torque(self) -> list[str]:
        choice, table = self.reading.tau, self.reading.torque_table
        doubt = self._doubt("tau", choice.group, self.reading.q.group)
        if choice.group is None or self.tau is None or doubt is not None:
            return self._open("tau", choice, doubt)
        named = self._named(choice.group, table)
        scales = stated_scale(table.notes, choice.group.quantity) if None in named and _whole(self.tau) else []
        named = tuple(unit or (scales[0].value if len(scales) == 1 else None) for unit in named)
        guess = self._torque_unit(self.tau, choice.group, named[0])
        self.current = guess.value in ("A", "mA") or (self.current and not guess.value)
        units = [_unit_of_joint(unit, guess.value, next(filter(None, named), None)) for unit in named]
        own = unit_of_group(choice.group.columns, table)
        if self.q is not None and self.q.shape == self.tau.shape:
            units = ["" if j in self._shares(own) else unit for j, unit in enumerate(units)]
        if guess.value == "N m" and self.joints:
            units = [unit if joint.revolute or unit != "N m" else "N" for unit, joint in zip(units, self.joints, strict=True)]
        file = f", file = {_quoted(table.source)}" if table is not self.reading.table else ""
        if len(scales) == 1:
            file += f", scale = {scales[0].number:g}"
            self.evidence.append(f"tau scale: the file states {clean(scales[0].words, 200)}")
        sign = Guess("as recorded", "unsure", "")
        if self.q is not None and self.q.shape == self.tau.shape:
            sign = sign_of(self.q, self.tau, self.links.signs if self.links is not None and self.links.followed else None)
            value = f'"{self.blank("signals.tau.sign")}"' if sign.value.endswith("?") else sign.value
            file += f", sign = {value}" if sign.value != "as recorded" else ""
        lines = [f"tau = {{ {_columns(choice.group.columns, table)}, unit = {self._units('tau', units)}{file} }}",
                 f"    {self.note('tau unit', guess)}", *(f"    {line}" for line in self._order(choice.group)),
                 *self._as_stated(choice.group, table)]
        if sign.why:
            lines.append(f"    {self.note('sign', sign)}")
        return [*lines, *_also(choice, self.reading.table)]

    def _torque_unit(self, tau: Array, group: Group, named: str | None) -> Guess:
        """Return the unit of the torques, "" where columns, file or positions leave it open."""
        q = self.reading.q.group
        guess, peak = torque_unit(tau, named, self.current, self.links, self.reading.message), f"up to {np.abs(tau).max():.4g}"
        if group.words == WITHOUT_NAME and named is None:
            return Guess("", "unsure", f"{peak}, neither position nor velocity: a torque in N m, or a current in A?")
        if guess.confidence == "sure":
            if self._noted_motor or (group.motor and not self.current and not self._followed):
                return replace(guess, confidence="unsure", why=f"{guess.why}: at the joint, or on the motor's shaft?")
            return guess
        if guess.value == "N m" and self.joints and q is not None and "" in self._position_units(q)[0]:  # outside their limits
            return Guess("", "unsure", f"{peak}: N m of the joint, or of the motor's shaft, as the positions may be?")
        if group.words == BY_FILE:
            file = clean(self.reading.torque_table.source, 60)
            return Guess("", "unsure", f"{peak}, of a file named '{file}': a torque in N m, or a current in A?")
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
        named = self._position_units(group)[0]
        units = {unit: [unit] * self.n for unit in _ANGLES}
        if any(self._named(group, self.reading.table)):
            if not set(named) <= UNITS.keys():
                return {}
            units |= {_NAMED: named}
        factors = {key: np.array([UNITS[unit].factor for unit in each]) for key, each in units.items()}
        return fits_by_unit(partial(self.model, robot), q, self.tau, t, factors)

    def _links(self) -> LinkFit | None:
        """Return the fit by links in the unit of the positions, where that is open the best; None where the links say nothing."""
        if not self.fits or self.reading.q.group is None:
            return None
        unit = self._position_units(self.reading.q.group)[0][0]
        fits = [fit for key, fit in self.fits.items() if key in (_NAMED, unit)] or list(self.fits.values())
        fits = [fit for fit in fits if fit.followed] or [fit for fit in fits if fit.varies]
        best = min(fits, key=lambda fit: fit.left, default=None)
        return best if best is not None and best.varies else None

    def _open(self, signal: str, choice: Choice, doubt: str | None = None) -> list[str]:
        """Return a blank line with the candidates, and why none of them was taken."""
        lines = [f'{signal} = {{ columns = "{self.blank(f"signals.{signal}")}", unit = "{BLANK}" }}']
        found = [*([choice.group] if choice.group else []), *choice.others]
        if not found:
            lines[0] += "   # no column looks like it"
            return lines
        self.evidence.append(f"{signal}: {len(found)} candidates, none of them certain")
        lines += [f"    # {doubt}"] if doubt else []
        if all(group.origin == "commanded" for group in found):
            lines.append("    # named commands, or the points of a plan: what was measured?")
        texts = ", ".join(clean(text, 40) for text in texts_of(self.reading.table, ())) if found[0].order == "text" else ""
        order = f"these are {texts}" if texts else "in the order of the file"
        ask = f"{order}; write them from the base to the tip"
        first = choice.group if not doubt else None
        lines += self._sister_lines()
        return [*lines, *(f"    # {ask if g is first else 'candidate'}: {_columns(g.columns, self.reading.table)}"
                         for g in found[:8])]

    def _sister_lines(self) -> list[str]:
        sisters = self.reading.sisters
        files = ", ".join(clean(name, 40) for name in sisters[:8])
        return [f"    # one file a joint? beside this one are {files}: join them, one column a joint"] if sisters else []

    def _drive(self) -> list[str]:
        """Return [drive]: a blank where positions are named the motor's, or start as a motor's do, else a comment."""
        group = self.reading.q.group
        if group and (self.at_turns or self._noted_motor or (group.motor and "theta" not in group.words and not self._followed)):
            lines = ["[drive]                  # of motors, by name, note or start: q_motor = N q_joint, tau_joint = N^T tau_motor",
                     f'transmission = "{self.blank("drive.transmission")}"   # gear ratio of each joint; '
                     "remove [drive] where they are the joints'", *self._stated_gear()]
        else:
            lines = [f"{'' if self.current else '# '}[drive]                # where numbers are motor side: q_motor = N q_joint, "
                     "tau_joint = N^T tau_motor", *(self._stated_gear() or [f"# transmission = [{', '.join(['100.0'] * self.n)}]"])]
        if self.current:
            blank = self.blank("drive.torque_constant")
            lines.append(f'torque_constant = "{blank}"             # N m/A, motor side: from the data sheet')
        return [*lines, ""]

    def _stated_gear(self) -> list[str]:
        """Return the gear ratios that the file states, for a person to confirm with their signs; nothing where it states none."""
        gear = stated_gear(self.reading.table.notes)
        if gear is None:
            return []
        ratios = f": transmission = [{', '.join([f'{gear.number:g}'] * self.n)}]" if gear.value else ""
        return [f"# the file states '{clean(gear.words.strip(chr(39)), 200)}'{ratios}, + where motor and joint turn alike"]

    @property
    def _followed(self) -> bool:
        """Tell whether the robot's links confirm torque and motion as those of the joints, in size as well."""
        group = self.reading.tau.group
        named = self._named(group, self.reading.torque_table)[0] if group else None
        unit, links = UNITS.get(named or "N m"), self.links
        return links is not None and unit is not None and links.followed and not unlike_links(links, unit.factor, named=False)

    @property
    def _noted_motor(self) -> bool:
        """Tell whether a line of the file says that its numbers are the motors', or names a gear, and no links deny it."""
        notes = self.reading.table.notes
        return not self._followed and (stated_gear(notes) is not None or any(_MOTOR_SIDE.search(note) for note in notes))

    def _missing(self) -> list[str]:
        """Return [missing] with the numbers that mark a lost sample; nothing where none does."""
        if not self.lost:
            return []
        guess = Guess(str(self.lost), "likely", "far from all other numbers of its column, in several cells: a lost sample")
        return ["[missing]", f"values = {self.lost}   {self.note('missing', guess)}", ""]

    def _resample(self) -> list[str]:
        if self.t is None:
            return []
        steps = np.diff(self.t)
        median = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
        uneven = float(np.percentile(np.abs(steps - median), 95)) / median
        if uneven < 0.05:
            self.evidence.append(f"time is even within {100 * uneven:.2g} %")
            return [f"# time is even within {100 * uneven:.2g} %, every {1e3 * median:.6g} ms: nothing to resample"]
        rate = round_rate(1.0 / median)
        guess = Guess(f"{rate:g} Hz", "likely",
                      f"steps of {1e3 * steps.min():.4g} to {1e3 * steps.max():.4g} ms, median {1e3 * median:.4g} ms: "
                      "the next round rate below, so that no sample is invented")
        return ["[resample]", f"rate = {rate:g}   {self.note('resample', guess)}", 'method = "spline"']


def _whole(values: Array) -> bool:
    return bool((values == np.round(values)).mean() > 0.99)


def _unit_of_joint(named: str | None, guessed: str, first: str | None) -> str:
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
    return near and (-_SHARE * full <= low < 0.3 * full or -(1.0 + _SHARE) * full <= low < -0.7 * full)


def _also(choice: Choice, table: RawTable) -> list[str]:
    """Return comments that name the other columns of that quantity."""
    return [f"    # also there: {group.words} ({group.quantity}, {group.origin}), {_columns(group.columns, table)}"
            for group in choice.others[:6] if not group.partial]


def _columns(names: Sequence[str], table: RawTable) -> str:
    """Return columns = "q_{j}" where the names count from 1, and no further column of `table` goes on, else a list."""
    if len(names) == 1:
        return f"column = {_quoted(names[0])}"
    before, one, after = names[0].rpartition("1")
    pattern = f"{before}{{j}}{after}" if one else names[0]
    counted = [pattern.replace("{j}", str(j)) for j in range(1, len(names) + 2)]
    if "{j}" in pattern and counted[:-1] == list(names) and counted[-1] not in table.columns:
        return f"columns = {_quoted(pattern)}"
    return f"columns = [{', '.join(map(_quoted, names))}]"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
