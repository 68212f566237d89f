"""Draft a recipe for a recording, with the evidence for every guess, for a person to correct.

The draft says what each value rests on: a name, a limit of the robot in the folder, the agreement
of a velocity with the slope of a position, jumps of one size, the sign of the power. What neither
names nor numbers decide is marked FILL IN, with the candidates; what is likely is marked "check:".
"""

from __future__ import annotations

import glob
import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipelines.errors import clean
from pipelines.importers.clock import median_step, round_rate
from pipelines.importers.config import CHOICE, EVIDENCE, NOTES
from pipelines.importers.evidence import Guess, held
from pipelines.importers.groups import Choice, Group, texts_of, unit_of_group
from pipelines.importers.inference import Inference, Model, unit_of_joint
from pipelines.importers.notes import stated_gear, stated_of_some_joints, stated_scale
from pipelines.importers.raw import RawTable
from pipelines.importers.recipe import BLANK, blanks_of
from pipelines.importers.recording import read_recording
from pipelines.importers.units_of_draft import velocity_unit, whole
from pipelines.io.sandbox import parse_toml
from pipelines.io.units import UNITS

_ONE_JOINT = f"""[robot]                                 # check: one joint, about the z axis
name = "one-joint"
# gravity: [0.0, 0.0, -9.81] on a vertical axis, where it does no work; \
[0.0, -9.81, 0.0] on a horizontal one
gravity = "{BLANK}"

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
_TORQUE_CONSTANT = re.compile(r"torque[ _-]?const|\bk_?t\b|N ?m/A", re.IGNORECASE)
_MOTORS = "q_motor = N q_joint, tau_joint = N^T tau_motor"


@dataclass(frozen=True)
class Draft:
    """A recipe to be checked by a person, and what it rests on."""

    text: str
    evidence: tuple[str, ...]

    @property
    def blanks(self) -> tuple[str, ...]:
        """Return what must be filled in before it runs: "robot.use", "signals.q", …"""
        places = (re.sub(r"\.columns?$|\[\d+\]$", "", x) for x in blanks_of(parse_toml(self.text)))
        whole = tuple(dict.fromkeys(places))
        return tuple(x for x in whole if x.removesuffix(".unit") not in set(whole) - {x})


def guess_recipe(path: Path, robot: str | None = None, model: Model | None = None) -> Draft:
    """Return a commented recipe for the recording in `path` and its companion file.

    Args:
        robot: description to use instead of that in the folder of the recording.
        model: the torques (samples, joints) [N m] of a robot at q, dq, ddq [rad], None where its
            links are unknown.

    Raises:
        InputRejected: the file cannot be read as a table of numbers.
    """
    return _Drafting(Inference(read_recording(path, robot), model)).draft()


class _Drafting:
    """The lines of a draft. Not frozen: it collects evidence on the way."""

    def __init__(self, found: Inference) -> None:
        self.found, self.reading = found, found.reading
        self.evidence: list[str] = []
        self.current = found.current

    def note(self, what: str, guess: Guess) -> str:
        """Return the comment behind a guessed value: confidence, evidence, and what to check."""
        why = clean(guess.why, 300)
        self.evidence.append(f"{what}: {guess.value or 'open'} ({guess.confidence}: {why})")
        return f"# {'check: ' if guess.confidence != 'sure' else ''}{guess.confidence}, {why}"

    def draft(self) -> Draft:
        table, name = self.reading.table, clean(self.reading.path.name, 80)
        columns = ", ".join(clean(c, 40) for c in table.columns)
        size = f"{table.rows.size} samples, columns {columns}"
        lines = [
            f"# Drafted by `rrrid import --guess {name}`: {size}.",
            *(f"# {clean(c.message, 200)}." for c in table.checks if c.level != "ok"),
            f'# Go through every "check:" and fill in what says {BLANK}; then: '
            "rrrid import RECIPE.toml --source FOLDER",
            *("", *self._robot(), "[log]"),
            f"match = {_quoted(self.reading.path.name)}      "
            '# a pattern such as "run_{number}.csv" takes many files',
            'experiment = "free"                     '
            "# check: friction | excitation | writing | frf | hold | free",
            'role = "identify"                       # check: identify | validate | reference',
            *(self._held(), "", "[time]", *self._time(), "", *self._map_hint(), "[signals]"),
            *(*self._sentences(), *self._position(), *self._velocity(), *self._torque()),
            *("", *self._drive(), "", *self._missing(), *self._resample()),
        ]
        return Draft("\n".join(lines) + "\n", tuple(self.evidence))

    def _robot(self) -> list[str]:
        arm, n = self.reading.arm, self.found.n
        if len(arm.files) == 1:
            why = (
                "as --robot says" if arm.named else "check: likely, the robot beside the recording"
            )
            lines = ["[robot]", f"use = {_quoted(arm.files[0])}   # {why}"]
            if arm.problem:
                self.evidence.append(f"robot: {clean(arm.problem, 300)}")
                lines.append(f"# {clean(arm.problem, 300)}")
                lines += [f'tip_link = "{BLANK}"'] if "tip_link" in arm.problem else []
            return [*lines, ""]
        known = self.reading.q.group or self.reading.tau.group
        if not arm.files and known and n == 1 and not self.reading.sisters:
            return _ONE_JOINT.split("\n")
        which = "robot.toml, a URDF, or a shipped name"
        if arm.files:
            which = f"one of {', '.join(clean(file, 40) for file in arm.files)}"
        joints = f" of {n} joints" if known and n > 1 else ""
        return ["[robot]", f'use = "{BLANK}"   # the robot{joints}: {which}', *self._sisters(), ""]

    def _sisters(self) -> list[str]:
        files = ", ".join(clean(name, 40) for name in self.reading.sisters[:8])
        line = f"    # one file a joint? beside this one are {files}: join them, one column a joint"
        return [line] if files else []

    def _held(self) -> str:
        """Return `torque = …`: by the name of its columns, else by whether it is held."""
        group, tau, q = self.reading.tau.group, self.found.tau, self.found.q
        column = f"column '{clean(group.columns[0], 40)}'" if group else ""
        if group is None or tau is None:
            why = 'the torque is open; "held-command" where the drive was commanded'
            guess = Guess("measured", "unsure", why)
        elif group.origin == "commanded":
            guess = Guess("held-command", "likely", f"{column} is named a command")
        elif self.current:
            guess = Guess("measured", "likely", "a current is sampled like the position")
        elif group.origin == "measured":
            guess = Guess("measured", "sure", f"{column} is named a measurement")
        else:
            guess = held(tau, q if q is not None else tau)
        return f'torque = "{guess.value}"   {self.note("torque", guess)}'

    def _time(self) -> list[str]:
        """Return [time]: a column, or the rate that the file states or a velocity shows."""
        clock, found = self.reading.clock, self.found
        known = math.isfinite(found.rate)
        rate = f"rate = {found.rate:g}   {self.note('rate', found.rate_guess)}" if known else ""
        if clock is None:
            self.evidence += [] if known else ["rate: no column of time"]
            why = found.rate_guess.why or "no column rises steadily, so only you know it"
            blank = f'rate = "{BLANK}"                        # Hz; {clean(why, 200)}'
            return [rate or blank]
        if clock.paired:
            columns, units = (", ".join(map(_quoted, x)) for x in (clock.columns, clock.units))
            note = self.note("time unit", found.clock_guess)
            return [f"column = [{columns}]", f"unit = [{units}]   {note}"]
        unit = found.clock_unit or BLANK
        lines = [f"column = {_quoted(clock.columns[0])}"]
        lines.append(f'unit = "{unit}"   {self.note("time unit", found.clock_guess)}')
        return [*lines, rate or f'rate = "{BLANK}"   # Hz'] if unit == "sample" else lines

    def _map_hint(self) -> list[str]:
        """Return a hint where positions rise in even steps without a clock: no motion, a map."""
        group, q = self.reading.q.group, self.found.q
        if self.reading.clock is not None or math.isfinite(self.found.rate):
            return []
        steps = np.diff(q[:, 0]) if q is not None and q.shape[1] == 1 else np.zeros(0)
        rising = steps.size >= EVIDENCE.map_least and ((steps > 0).all() or (steps < 0).all())
        if group is None or not rising or np.std(steps) > EVIDENCE.map_even * abs(np.mean(steps)):
            return []
        self.evidence.append("positions rise in even steps without a clock: a map")
        name, file = clean(group.columns[0], 40), _quoted(self.reading.path.name)
        goes_on = f"{name} goes on in even steps of {np.mean(steps):.4g}"
        columns = "columns = { position = { column = …, unit = … }, … }"
        return [
            f"# check: likely a map and no log, {goes_on};",
            "#     then delete [log], [time] and [signals], and write",
            f"#     [[table]] match = {file}, {columns}",
        ]

    def _sentences(self) -> list[str]:
        """Return the file's sentences about some joints alone: a zero, a sign, a coupling."""
        notes = self.reading.table.notes
        said = [
            f"the file says '{clean(line, 200)}'"
            for line in stated_of_some_joints(notes, self.found.n)[: NOTES.most_sentences]
        ]
        self.evidence += [f"joints: {words}" for words in said]
        return [f"# check: {words}: do the numbers below need it?" for words in said]

    def _position(self) -> list[str]:
        choice, table, q = self.reading.q, self.reading.table, self.found.q
        doubt = self.found.doubt("q", choice.group, self.reading.tau.group)
        if choice.group is None or q is None or doubt is not None:
            return self._open("q", choice, doubt)
        units, further, why = self.found.position_units(choice.group)
        columns = _columns(choice.group.columns, table)
        lines = [f"q = {{ {columns}, unit = {_units(units)}{further} }}"]
        lines += [f"    {self.note('q unit', guess)}" for guess in why]
        lines += self._as_stated(choice.group, table) + _order(choice.group)
        if still := [str(j + 1) for j in np.flatnonzero(np.ptp(q, axis=0) == 0.0)]:
            lines.append(f"    # joint {', '.join(still)} never moves in this file")
        return [*lines, *_also(choice, table)]

    def _as_stated(self, group: Group, table: RawTable) -> list[str]:
        """Return a comment with the file's words that state a unit, or contradict each other."""
        said = self.found.statement(group, False, table)
        if said is None or None not in unit_of_group(group.columns, table):
            return []
        words = f"the file states {clean(said.words, 200)}"
        self.evidence.append(f"{group.quantity}: {words}")
        return [f"    # check: {'' if said.value else 'contradictory, '}{words}"]

    def _velocity(self) -> list[str]:
        """Return the line of a velocity that is the slope of the position; else a comment."""
        group, slope, table = self.reading.dq.group, self.found.slope, self.reading.table
        position, found = self.reading.q.group, self.found
        if group is None:
            return []
        unit = ""
        if slope is not None and found.t is not None and position is not None:
            open_order = found.out_of_order(group) or position.order != group.order
            doubt = found.doubt("q", position, self.reading.tau.group)
            turns = all(joint.type == "revolute" for joint in found.joints)
            if turns and not open_order and doubt is None:
                unit = velocity_unit(slope, found.position_units(position)[0][0])
                named = found.named(group, table)[0]
                unit = unit if UNITS.get(named or unit) == UNITS.get(unit) else ""
        columns = _columns(group.columns, table)
        if not unit or slope is None:
            return [f"    # left out: {group.words} (velocity), {columns}"]
        why = f"the position's slope is {slope.factor:.4g} times it"
        guess = Guess(unit, "likely", f"{why}; remove the line where it was not measured")
        line = f"dq = {{ {columns}, unit = {_quoted(unit)} }}"
        return [line, f"    {self.note('dq unit', guess)}"]

    def _torque(self) -> list[str]:
        choice, table = self.reading.tau, self.reading.torque_table
        group, found, tau = choice.group, self.found, self.found.tau
        doubt = found.doubt("tau", group, self.reading.q.group)
        if group is None or tau is None or doubt is not None:
            return self._open("tau", choice, doubt)
        named = found.named(group, table)
        stated = stated_scale(table.notes, group.quantity) if None in named and whole(tau) else []
        scale = stated[0] if len(stated) == 1 else None
        named = tuple(unit or (scale.value if scale else None) for unit in named)
        guess = found.torque_unit(tau, group, named[0])
        self.current = guess.value in ("A", "mA", "Arms") or (self.current and not guess.value)
        first = next(filter(None, named), None)
        units = [unit_of_joint(unit, guess.value, first) for unit in named]
        if found.q is not None and found.q.shape == tau.shape:
            shares = found.shares(unit_of_group(group.columns, table))
            units = ["" if j in shares else unit for j, unit in enumerate(units)]
        if guess.value == "N m" and found.joints:
            pairs = zip(units, found.joints, strict=True)
            units = ["N" if unit == "N m" and not j.revolute else unit for unit, j in pairs]
        further = self._file(table)
        if scale:
            further += f", scale = {scale.number:g}"
            self.evidence.append(f"tau scale: the file states {clean(scale.words, 200)}")
        sign = found.sign
        if sign.value.endswith("?"):
            further += f', sign = "{BLANK}"'
        elif sign.value != "as recorded":
            further += f", sign = {sign.value}"
        columns = _columns(group.columns, table)
        lines = [f"tau = {{ {columns}, unit = {_units(units)}{further} }}"]
        lines += [f"    {self.note('tau unit', guess)}", *_order(group)]
        lines += self._as_stated(group, table)
        lines += [f"    {self.note('sign', sign)}"] if sign.why else []
        return [*lines, *_also(choice, table)]

    def _open(self, signal: str, choice: Choice, doubt: str | None = None) -> list[str]:
        """Return a blank line with the candidates, and why none of them was taken."""
        table = self.reading.torque_table if signal == "tau" else self.reading.table
        line = f'{signal} = {{ columns = "{BLANK}", unit = "{BLANK}" }}'
        found = choice.left_open.others
        if not found:
            items = list(table.text.items())[:5]
            left = ", ".join(f"{clean(name, 40)} ({clean(text, 80)})" for name, text in items)
            further = [f"    # no columns of numbers: {left}"] if left else []
            needed = ", and a log needs a torque" if signal == "tau" else ""
            further += self._other_files() if signal == "tau" else []
            return [f"{line}   # no column looks like it{needed}", *further]
        self.evidence.append(f"{signal}: {len(found)} candidates, none of them certain")
        lines = [line, f"    # {doubt}"] if doubt else [line]
        if all(group.origin == "commanded" for group in found):
            lines.append("    # named commands, or the points of a plan: what was measured?")
        named = texts_of(table, ()) if found[0].order == "text" else ()
        texts = ", ".join(clean(text, 40) for text in named)
        order = f"these are {texts}" if texts else "in the order of the file"
        first = choice.group if not doubt else None
        lines += self._sisters()
        for group in found[:8]:
            ask = f"{order}; write them from the base to the tip" if group is first else "candidate"
            lines.append(f"    # {ask}: {_columns(group.columns, table)}{self._file(table)}")
        if beside := [f"file = {_quoted(name)}" for name in self.reading.beside[:8]]:
            lines.append(f"    # as many columns and rows: {', '.join(beside)}")
        return [*lines, *(self._other_files() if signal == "tau" and not beside else ())]

    def _file(self, table: RawTable) -> str:
        return f", file = {_quoted(table.source)}" if table is not self.reading.table else ""

    def _other_files(self) -> list[str]:
        """Return a comment with files of this folder whose names differ in more than numbers."""
        path = self.reading.path
        alike = re.sub(r"\d+", "#", path.name)
        near = sorted(path.parent.glob(f"*{glob.escape(path.suffix)}"))[: CHOICE.most_files]
        names = [
            p.name for p in near if p.suffix == path.suffix and p.name[0] != "." and p.is_file()
        ]
        others = [_quoted(name) for name in names if re.sub(r"\d+", "#", name) != alike]
        files = " or ".join(others[:4])
        return [f"    # if the torques are in another file: file = {files}"] if others else []

    def _drive(self) -> list[str]:
        """Return [drive]: a blank where positions are the motors', else a comment.

        Stated gear ratios and torque constants are quoted for a person to confirm.
        """
        notes, n = self.reading.table.notes, self.found.n
        gear, lines = stated_gear(notes), []
        if gear is not None:
            listed = ", ".join([f"{gear.number:g}"] * n)
            ratios = f": transmission = [{listed}]" if gear.value else ""
            said = f"the file states '{clean(gear.words.strip(chr(39)), 200)}'"
            lines = [f"# {said}{ratios}, + where motor and joint turn alike"]
        if self.found.of_motors:
            ratio = f'transmission = "{BLANK}"   # gear ratio of each joint; '
            lines = [
                f"[drive]                  # of motors, by name, note or start: {_MOTORS}",
                f"{ratio}remove [drive] where they are the joints'",
                *lines,
            ]
        else:
            mark = "" if self.current else "# "
            lines = [
                f"{mark}[drive]                # where numbers are motor side: {_MOTORS}",
                *(lines or [f"# transmission = [{', '.join(['100.0'] * n)}]"]),
            ]
        if self.current:
            said_of = [note.strip("# ") for note in notes if _TORQUE_CONSTANT.search(note)][:3]
            lines += [f"# the file states '{clean(line, 200)}'" for line in said_of]
            constant = f'torque_constant = "{BLANK}"'
            lines.append(f"{constant}             # N m/A, motor side: from the data sheet")
        return lines

    def _missing(self) -> list[str]:
        """Return [missing] with what marks a lost sample: numbers, rows of zeros; or nothing."""
        lines, lost, rows = [], list(self.reading.lost), self.reading.lost_rows
        if lost:
            why = "far from all other numbers of its column, in several cells: a lost sample"
            note = self.note("missing", Guess(str(lost), "likely", why))
            lines.append(f"values = {lost}   {note}")
        if rows:
            why = f"{rows} are zero in all that was measured, far from those around"
            note = self.note("missing", Guess("rows of zeros", "likely", why))
            lines.append(f"rows = [0.0]   {note}")
        return ["[missing]", *lines, ""] if lines else []

    def _resample(self) -> list[str]:
        if self.found.t is None:
            return []
        steps, median = np.diff(self.found.t), median_step(self.found.t)
        uneven = float(np.percentile(np.abs(steps - median), 95)) / median
        if uneven < EVIDENCE.even:
            even = f"time is even within {100 * uneven:.2g} %"
            self.evidence.append(even)
            return [f"# {even}, every {1e3 * median:.6g} ms: nothing to resample"]
        rate = round_rate(1.0 / median)
        why = f"steps of {1e3 * steps.min():.4g} to {1e3 * steps.max():.4g} ms, median "
        why += f"{1e3 * median:.4g} ms: the next round rate below, so that no sample is invented"
        note = self.note("resample", Guess(f"{rate:g} Hz", "likely", why))
        return ["[resample]", f"rate = {rate:g}   {note}", 'method = "spline"']


def _units(units: Sequence[str]) -> str:
    """Return the unit in TOML: one text, or one a joint; FILL IN where one is open."""
    words = [_quoted(unit or BLANK) for unit in units]
    return words[0] if len(set(words)) == 1 else f"[{', '.join(words)}]"


def _order(group: Group) -> list[str]:
    gripper = ", ".join(clean(column, 40) for column in group.gripper)
    left_out = f"    # left out, a gripper's by the file's names: {gripper}"
    lines = [left_out] if gripper else []
    if group.order == "robot":
        lines.append("    # in the order of the robot's joints, by their names")
    elif group.order == "file" and len(group.columns) > 1:
        taken = "the joints are taken in the order of the file, from the base to the tip"
        lines.append(f"    # check: {taken}")
    return lines


def _also(choice: Choice, table: RawTable) -> list[str]:
    """Return comments that name the other columns of that quantity."""
    lines = []
    for group in (group for group in choice.others[:6] if not group.partial):
        words = f"{group.words} ({group.quantity}, {group.origin})"
        lines.append(f"    # also there: {words}, {_columns(group.columns, table)}")
    return lines


def _columns(names: Sequence[str], table: RawTable) -> str:
    """Return columns = "q_{j}" where the names count from 1 to the table's last, else a list."""
    if len(names) == 1:
        return f"column = {_quoted(names[0])}"
    before, one, after = names[0].rpartition("1")
    counted = [f"{before}{j}{after}" for j in range(1, len(names) + 2)]
    if one and counted[:-1] == list(names) and counted[-1] not in table.columns:
        return f"columns = {_quoted(f'{before}{{j}}{after}')}"
    return f"columns = [{', '.join(map(_quoted, names))}]"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
