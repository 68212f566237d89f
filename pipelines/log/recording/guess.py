"""Draft a recipe for a recording, with the evidence for every guess, for a person to correct.

The draft says what each value rests on: a name, a limit of the robot beside the recording, the
agreement of a velocity with the slope of a position, jumps of one size, the sign of the power. What
neither names nor numbers decide is marked FILL IN, with the candidates; what is only likely is
marked "check:".
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipelines.errors import InputRejected, clean
from pipelines.log.recording.clock_guess import round_rate
from pipelines.log.recording.column_groups import (
    Choice,
    Group,
    lost_numbers,
    sound_samples,
    texts_of,
    unit_of_group,
)
from pipelines.log.recording.evidence import Guess, held, velocity_unit
from pipelines.log.recording.inference import Inference, Model, unit_of_joint, whole
from pipelines.log.recording.raw import RawTable
from pipelines.log.recording.reading import (
    arm_beside,
    companion_for,
    read_recording,
    with_companion,
)
from pipelines.log.recording.recipe_reader import BLANK
from pipelines.log.recording.sources import read_table
from pipelines.log.recording.stated import stated_gear, stated_of_some_joints, stated_scale
from pipelines.log.units import UNITS

__all__ = ["Draft", "guess_recipe"]

_MOST_COLUMNS = 2000
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
        message = f"{len(table.columns)} columns: too many to guess what each is"
        remedy = "export the joints' signals alone, or write the recipe"
        raise InputRejected("F16", message, where=path, remedy=remedy)
    lost = lost_numbers(table)
    table = sound_samples(table, lost)
    reading = read_recording(path, table, arm_beside(path.parent, robot))
    companion = companion_for(reading)
    if companion is not None:
        companion = sound_samples(companion, lost)
        reading = with_companion(
            reading, companion if np.array_equal(companion.rows, table.rows) else None
        )
    return _Drafting(Inference(reading, model), lost).draft()


class _Drafting:
    """Collects the lines of a draft. Not frozen: it is the pencil, the `Draft` is the result."""

    def __init__(self, found: Inference, lost: Sequence[float]) -> None:
        self.found, self.reading, self.lost = found, found.reading, lost
        self.evidence: list[str] = []
        self.blanks: list[str] = []
        self.current = found.current

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
        lines = [
            f"# Drafted by `rrrid import --guess {name}`: {table.rows.size} samples, columns {columns}."
        ]
        lines += [
            f"# {clean(check.message, 200)}." for check in table.checks if check.level != "ok"
        ]
        lines += [
            f'# Go through every "check:" and fill in what says {BLANK}; then: rrrid import RECIPE.toml --source FOLDER',
            "",
        ]
        lines += [
            *self._robot(),
            *self._log(),
            *self._time(),
            "[signals]",
            *self._remarks(),
            *self._position(),
            *self._velocity(),
            *self._torque(),
            "",
            *self._drive(),
            *self._missing(),
            *self._resample(),
        ]
        return Draft("\n".join(lines) + "\n", tuple(self.evidence), tuple(self.blanks))

    def _robot(self) -> list[str]:
        arm = self.reading.arm
        if len(arm.files) == 1:
            why = (
                "as --robot says" if arm.named else "check: likely, the robot beside the recording"
            )
            lines = ["[robot]", f"use = {_quoted(arm.files[0])}   # {why}"]
            if arm.problem:
                self.evidence.append(f"robot: {clean(arm.problem, 300)}")
                lines.append(f"# {clean(arm.problem, 300)}")
                if "tip_link" in arm.problem:
                    lines.append(f'tip_link = "{self.blank("robot.tip_link")}"')
            return [*lines, ""]
        known = self.reading.q.group or self.reading.tau.group
        if not arm.files and known and self.found.n == 1 and not self.reading.sisters:
            self.blanks.append("robot.gravity")
            return _ONE_JOINT.split("\n")
        which = "robot.toml, a URDF, or a shipped name"
        if arm.files:
            which = f"one of {', '.join(clean(file, 40) for file in arm.files)}"
        joints = f" of {self.found.n} joints" if known and self.found.n > 1 else ""
        return [
            "[robot]",
            f'use = "{self.blank("robot.use")}"   # the robot{joints}: {which}',
            *self._sister_lines(),
            "",
        ]

    def _log(self) -> list[str]:
        name = _quoted(self.reading.path.name)
        return [
            "[log]",
            f'match = {name}      # a pattern such as "run_{{number}}.csv" takes many files',
            'experiment = "free"                     # check: friction | excitation | writing | frf | hold | free',
            'role = "identify"                       # check: identify | validate | reference',
            self._held(),
            "",
        ]

    def _held(self) -> str:
        """Return `torque = …`: by the name of its columns, else by whether it is held over samples."""
        group = self.reading.tau.group
        if group is None:
            guess = Guess(
                "measured",
                "unsure",
                'the torque is open; "held-command" where the drive was commanded',
            )
        elif group.origin == "commanded":
            guess = Guess(
                "held-command",
                "likely",
                f"column '{clean(group.columns[0], 40)}' is named a command",
            )
        elif self.current:
            guess = Guess("measured", "likely", "a current is sampled like the position")
        elif group.origin == "measured":
            guess = Guess(
                "measured", "sure", f"column '{clean(group.columns[0], 40)}' is named a measurement"
            )
        else:
            assert self.found.tau is not None
            guess = held(
                self.found.tau, self.found.q if self.found.q is not None else self.found.tau
            )
        return f'torque = "{guess.value}"   {self.note("torque", guess)}'

    def _time(self) -> list[str]:
        clock = self.reading.clock
        if clock is None:
            return self._rate()
        if clock.paired:
            return [
                "[time]",
                f"column = [{', '.join(map(_quoted, clock.columns))}]",
                f'unit = ["{clock.units[0]}", "{clock.units[1]}"]   {self.note("time unit", self.found.clock_guess)}',
                "",
            ]
        lines = ["[time]", f"column = {_quoted(clock.columns[0])}"]
        unit = self.found.clock_unit or self.blank("time.unit")
        lines.append(f'unit = "{unit}"   {self.note("time unit", self.found.clock_guess)}')
        if self.found.clock_unit == "sample" and math.isfinite(self.found.rate):
            lines.append(f"rate = {self.found.rate:g}   {self.note('rate', self.found.rate_guess)}")
        elif self.found.clock_unit == "sample":
            lines.append(f'rate = "{self.blank("time.rate")}"   # Hz')
        return [*lines, ""]

    def _rate(self) -> list[str]:
        """Return [time] without a column: the rate that the file states, or a recorded velocity shows."""
        if math.isfinite(self.found.rate):
            return [
                "[time]",
                f"rate = {self.found.rate:g}   {self.note('rate', self.found.rate_guess)}",
                "",
            ]
        self.evidence.append("rate: no column of time")
        self.blanks.append("time.rate")
        why = self.found.rate_guess.why or "no column rises steadily, so only you know it"
        return [
            "[time]",
            f'rate = "{BLANK}"                        # Hz; {clean(why, 200)}',
            *self._map_hint(),
            "",
        ]

    def _map_hint(self) -> list[str]:
        """Positions that rise in even steps without a clock are a map rather than a motion."""
        group = self.reading.q.group
        steps = (
            np.diff(self.found.q[:, 0])
            if self.found.q is not None and self.found.q.shape[1] == 1
            else np.zeros(0)
        )
        even = (steps > 0).all() or (steps < 0).all()
        if (
            group is None
            or steps.size < 10
            or not even
            or np.std(steps) > 0.2 * abs(np.mean(steps))
        ):
            return []
        self.evidence.append("positions rise in even steps without a clock: a map")
        name, file = clean(group.columns[0], 40), _quoted(self.reading.path.name)
        return [
            f"# check: likely a map and no log, {name} goes on in even steps of {np.mean(steps):.4g};",
            "#     then delete [log], [time] and [signals], and write",
            f"#     [[table]] match = {file}, columns = {{ position = {{ column = …, unit = … }}, … }}",
        ]

    def _remarks(self) -> list[str]:
        """Return comments with the sentences of the file about some joints alone: a zero, a sign, a coupling."""
        said = [
            clean(line, 200)
            for line in stated_of_some_joints(self.reading.table.notes, self.found.n)[:3]
        ]
        self.evidence += [f"joints: the file says '{line}'" for line in said]
        return [f"# check: the file says '{line}': do the numbers below need it?" for line in said]

    def _position(self) -> list[str]:
        choice = self.reading.q
        doubt = self.found.doubt("q", choice.group, self.reading.tau.group)
        if choice.group is None or self.found.q is None or doubt is not None:
            return self._open("q", choice, doubt)
        units, further, why = self.found.position_units(choice.group)
        if BLANK in further:
            self.blanks.append("signals.q.counts_per_rev")
        lines = [
            f"q = {{ {_columns(choice.group.columns, self.reading.table)}, unit = {self._units('q', units)}{further} }}"
        ]
        lines += [f"    {self.note('q unit', guess)}" for guess in why]
        lines += self._as_stated(choice.group, self.reading.table)
        lines += [f"    {comment}" for comment in self._order(choice.group)]
        if still := [str(j + 1) for j in np.flatnonzero(np.ptp(self.found.q, axis=0) == 0.0)]:
            lines.append(f"    # joint {', '.join(still)} never moves in this file")
        return [*lines, *_also(choice, self.reading.table)]

    def _as_stated(self, group: Group, table: RawTable) -> list[str]:
        """Return a comment with the words of the file that a unit was taken from, or that contradict each other."""
        said = self.found.statement(group.quantity, False, group.motor, table)
        if said is None or None not in unit_of_group(group.columns, table):
            return []
        self.evidence.append(f"{group.quantity}: the file states {clean(said.words, 200)}")
        return [
            f"    # check: {'' if said.value else 'contradictory, '}the file states {clean(said.words, 200)}"
        ]

    def _units(self, signal: str, units: Sequence[str]) -> str:
        """Return the unit in TOML: one text, or one a joint where they differ; FILL IN where one is open."""
        if "" in units:
            self.blanks.append(f"signals.{signal}.unit")
        words = [unit or BLANK for unit in units]
        return f'"{words[0]}"' if len(set(words)) == 1 else f"[{', '.join(map(_quoted, words))}]"

    def _order(self, group: Group) -> list[str]:
        if group.order == "robot":
            return ["# in the order of the robot's joints, by their names"]
        if group.order == "file" and len(group.columns) > 1:
            return [
                "# check: the joints are taken in the order of the file, from the base to the tip"
            ]
        return []

    def _velocity(self) -> list[str]:
        """Return the line of a recorded velocity that is the slope of the position; nothing where none is."""
        group, slope = self.reading.dq.group, self.found.slope
        if (
            group is None
            or slope is None
            or self.found.t is None
            or self.found.q is None
            or not self.reading.q.group
        ):
            return []
        position = self.reading.q.group
        if (
            any(joint.type != "revolute" for joint in self.found.joints)
            or self.found.out_of_order(group)
            or (
                position.order != group.order
                or self.found.doubt("q", position, self.reading.tau.group) is not None
            )
        ):
            return []
        named = self.found.named(group, self.reading.table)[0]
        unit = velocity_unit(slope, self.found.position_units(self.reading.q.group)[0][0])
        if not unit or UNITS.get(named or unit) != UNITS[unit]:
            return []
        guess = Guess(
            unit,
            "likely",
            f"the position's slope is {slope.factor:.4g} times it; remove the line where it was not measured",
        )
        columns = _columns(group.columns, self.reading.table)
        return [
            f"dq = {{ {columns}, unit = {_quoted(unit)} }}",
            f"    {self.note('dq unit', guess)}",
        ]

    def _torque(self) -> list[str]:
        choice, table = self.reading.tau, self.reading.torque_table
        doubt = self.found.doubt("tau", choice.group, self.reading.q.group)
        if choice.group is None or self.found.tau is None or doubt is not None:
            return self._open("tau", choice, doubt)
        named = self.found.named(choice.group, table)
        scales = (
            stated_scale(table.notes, choice.group.quantity)
            if None in named and whole(self.found.tau)
            else []
        )
        named = tuple(unit or (scales[0].value if len(scales) == 1 else None) for unit in named)
        guess = self.found.torque_unit(self.found.tau, choice.group, named[0])
        self.current = guess.value in ("A", "mA") or (self.current and not guess.value)
        units = [
            unit_of_joint(unit, guess.value, next(filter(None, named), None)) for unit in named
        ]
        own = unit_of_group(choice.group.columns, table)
        if self.found.q is not None and self.found.q.shape == self.found.tau.shape:
            units = ["" if j in self.found.shares(own) else unit for j, unit in enumerate(units)]
        if guess.value == "N m" and self.found.joints:
            units = [
                unit if joint.revolute or unit != "N m" else "N"
                for unit, joint in zip(units, self.found.joints, strict=True)
            ]
        file = f", file = {_quoted(table.source)}" if table is not self.reading.table else ""
        if len(scales) == 1:
            file += f", scale = {scales[0].number:g}"
            self.evidence.append(f"tau scale: the file states {clean(scales[0].words, 200)}")
        sign = self.found.sign
        if sign.value != "as recorded":
            value = (
                f'"{self.blank("signals.tau.sign")}"' if sign.value.endswith("?") else sign.value
            )
            file += f", sign = {value}"
        lines = [
            f"tau = {{ {_columns(choice.group.columns, table)}, unit = {self._units('tau', units)}{file} }}",
            f"    {self.note('tau unit', guess)}",
            *(f"    {line}" for line in self._order(choice.group)),
            *self._as_stated(choice.group, table),
        ]
        if sign.why:
            lines.append(f"    {self.note('sign', sign)}")
        return [*lines, *_also(choice, self.reading.table)]

    def _open(self, signal: str, choice: Choice, doubt: str | None = None) -> list[str]:
        """Return a blank line with the candidates, and why none of them was taken."""
        lines = [
            f'{signal} = {{ columns = "{self.blank(f"signals.{signal}")}", unit = "{BLANK}" }}'
        ]
        found = [*([choice.group] if choice.group else []), *choice.others]
        if not found:
            lines[0] += "   # no column looks like it"
            left = [
                f"{clean(name, 40)} ({clean(text, 80)})"
                for name, text in self.reading.table.text.items()
            ]
            return (
                [*lines, f"    # no columns of numbers: {', '.join(left[:5])}"] if left else lines
            )
        self.evidence.append(f"{signal}: {len(found)} candidates, none of them certain")
        lines += [f"    # {doubt}"] if doubt else []
        if all(group.origin == "commanded" for group in found):
            lines.append("    # named commands, or the points of a plan: what was measured?")
        texts = (
            ", ".join(clean(text, 40) for text in texts_of(self.reading.table, ()))
            if found[0].order == "text"
            else ""
        )
        order = f"these are {texts}" if texts else "in the order of the file"
        ask = f"{order}; write them from the base to the tip"
        first = choice.group if not doubt else None
        lines += self._sister_lines()
        return [
            *lines,
            *(
                f"    # {ask if g is first else 'candidate'}: {_columns(g.columns, self.reading.table)}"
                for g in found[:8]
            ),
        ]

    def _sister_lines(self) -> list[str]:
        sisters = self.reading.sisters
        files = ", ".join(clean(name, 40) for name in sisters[:8])
        return (
            [f"    # one file a joint? beside this one are {files}: join them, one column a joint"]
            if sisters
            else []
        )

    def _drive(self) -> list[str]:
        """Return [drive]: a blank where positions are named the motor's, or start as a motor's do, else a comment."""
        if self.found.of_motors:
            lines = [
                "[drive]                  # of motors, by name, note or start: q_motor = N q_joint, tau_joint = N^T tau_motor",
                f'transmission = "{self.blank("drive.transmission")}"   # gear ratio of each joint; '
                "remove [drive] where they are the joints'",
                *self._stated_gear(),
            ]
        else:
            lines = [
                f"{'' if self.current else '# '}[drive]                # where numbers are motor side: q_motor = N q_joint, "
                "tau_joint = N^T tau_motor",
                *(
                    self._stated_gear()
                    or [f"# transmission = [{', '.join(['100.0'] * self.found.n)}]"]
                ),
            ]
        if self.current:
            blank = self.blank("drive.torque_constant")
            lines.append(
                f'torque_constant = "{blank}"             # N m/A, motor side: from the data sheet'
            )
        return [*lines, ""]

    def _stated_gear(self) -> list[str]:
        """Return the gear ratios that the file states, for a person to confirm with their signs; nothing where it states none."""
        gear = stated_gear(self.reading.table.notes)
        if gear is None:
            return []
        ratios = (
            f": transmission = [{', '.join([f'{gear.number:g}'] * self.found.n)}]"
            if gear.value
            else ""
        )
        return [
            f"# the file states '{clean(gear.words.strip(chr(39)), 200)}'{ratios}, + where motor and joint turn alike"
        ]

    def _missing(self) -> list[str]:
        """Return [missing] with the numbers that mark a lost sample; nothing where none does."""
        if not self.lost:
            return []
        guess = Guess(
            str(self.lost),
            "likely",
            "far from all other numbers of its column, in several cells: a lost sample",
        )
        return ["[missing]", f"values = {self.lost}   {self.note('missing', guess)}", ""]

    def _resample(self) -> list[str]:
        if self.found.t is None:
            return []
        steps = np.diff(self.found.t)
        median = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
        uneven = float(np.percentile(np.abs(steps - median), 95)) / median
        if uneven < 0.05:
            self.evidence.append(f"time is even within {100 * uneven:.2g} %")
            return [
                f"# time is even within {100 * uneven:.2g} %, every {1e3 * median:.6g} ms: nothing to resample"
            ]
        rate = round_rate(1.0 / median)
        guess = Guess(
            f"{rate:g} Hz",
            "likely",
            f"steps of {1e3 * steps.min():.4g} to {1e3 * steps.max():.4g} ms, median {1e3 * median:.4g} ms: "
            "the next round rate below, so that no sample is invented",
        )
        return [
            "[resample]",
            f"rate = {rate:g}   {self.note('resample', guess)}",
            'method = "spline"',
        ]


def _also(choice: Choice, table: RawTable) -> list[str]:
    """Return comments that name the other columns of that quantity."""
    return [
        f"    # also there: {group.words} ({group.quantity}, {group.origin}), {_columns(group.columns, table)}"
        for group in choice.others[:6]
        if not group.partial
    ]


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
