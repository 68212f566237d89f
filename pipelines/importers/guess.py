"""Draft a recipe for a recording, with the evidence for every guess, for a person to correct.

The draft says what each value rests on: a name, a limit of the robot in the folder, the agreement
of a velocity with the slope of a position, jumps of one size, the sign of the power. What neither
names nor numbers decide is marked FILL IN, with the candidates; what is likely is marked "check:".
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipelines.errors import clean
from pipelines.importers.clock import median_step, round_rate
from pipelines.importers.columns import Group, own_units
from pipelines.importers.config import CHOICE, EVIDENCE, NOTES
from pipelines.importers.evidence import Guess, held
from pipelines.importers.hypotheses import NAMED, Findings, Model, infer, named_units, statement
from pipelines.importers.notes import stated_gear, stated_of_some_joints
from pipelines.importers.raw import RawTable
from pipelines.importers.recipe import BLANK, blanks_of
from pipelines.importers.signals import Choice, read_recording
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
# Parts of an arm.
_BASE_TO_TIP = ("base", "torso", "waist", "shoulder", "elbow", "forearm", "wrist", "hand")
_SPEEDS = ("rad/s", "deg/s", "rev/s", "rpm", "mrad/s", "mdeg/s")
_TORQUE_CONSTANT = re.compile(r"torque[ _-]?const|\bk_?t\b|N ?m/A", re.IGNORECASE)
_MOTORS = "q_motor = N q_joint, tau_joint = N^T tau_motor"
_FILE_OF_AXIS = re.compile(
    r"(.*(?:joint|axis|axe|achse|motor|mot|id|actuator|servo|drive|node|j|m|a)[ _-]?)(\d+)(\D*)",
    re.IGNORECASE,
)


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
        model: the torque of a robot's links by its description.

    Raises:
        InputRejected: the file cannot be read as a table of numbers.
    """
    return _Drafting(infer(read_recording(path, robot), model)).draft()


class _Drafting:
    """The lines of a draft. Not frozen: it collects evidence on the way."""

    def __init__(self, found: Findings) -> None:
        self.found, self.reading = found, found.reading
        self.evidence: list[str] = []

    def note(self, what: str, guess: Guess) -> str:
        """Return the comment behind a guessed value: confidence, evidence, and what to check."""
        why = clean(guess.why, 300)
        self.evidence.append(f"{what}: {guess.value or 'open'} ({guess.confidence}: {why})")
        return f"# {'check: ' if guess.confidence != 'sure' else ''}{guess.confidence}, {why}"

    def draft(self) -> Draft:
        table, name = self.reading.table, clean(self.reading.path.name, 80)
        columns = ", ".join(clean(c, 40) for c in table.columns)
        size = f"{table.rows.size} samples, columns {columns}"
        said = stated_of_some_joints(table.notes, self.reading.joints)[: NOTES.most_sentences]
        lines = [
            f"# Drafted by `rrrid import --guess {name}`: {size}.",
            *(f"# {clean(c.message, 200)}." for c in table.checks if c.level != "ok"),
            f'# Go through every "check:" and fill in what says {BLANK}; then: '
            "rrrid import RECIPE.toml --source FOLDER",
            *("", *self._robot(), "", "[log]"),
            f"match = {_quoted(self.reading.path.name)}      "
            '# a pattern such as "run_{number}.csv" takes many files',
            'experiment = "free"                     '
            "# check: friction | excitation | writing | frf | hold | free",
            'role = "identify"                       # check: identify | validate | reference',
            *(self._held(), "", "[time]", *self._time(), "", *self._map_hint(), "[signals]"),
            *(f"# check: the file says '{clean(x, 200)}': do the numbers need it?" for x in said),
            *(*self._position(), *self._velocity(), *self._torque()),
            *("", *self._drive(), "", *self._missing(), *self._resample()),
        ]
        return Draft("\n".join(lines) + "\n", tuple(self.evidence))

    def _robot(self) -> list[str]:
        arm, n = self.reading.arm, self.reading.joints
        if len(arm.files) == 1:
            why = "as --robot says" if arm.named else "check: likely, it lies in the same folder"
            lines = ["[robot]", f"use = {_quoted(arm.files[0])}   # {why}"]
            lines += [f"# {clean(arm.problem, 300)}"] if arm.problem else []
            return [*lines, *([f'tip_link = "{BLANK}"'] if "tip_link" in arm.problem else [])]
        known, files = self.reading.q.group or self.reading.tau.group, self._files_of_axes()
        if not arm.files and known and n == 1 and not files:
            return _ONE_JOINT.rstrip().split("\n")
        which = "robot.toml, a URDF, or a shipped name"
        if arm.files:
            which = f"one of {', '.join(clean(file, 40) for file in arm.files)}"
        joints = f" of {n} joints" if known and n > 1 else ""
        return ["[robot]", f'use = "{BLANK}"   # the robot{joints}: {which}', *files]

    def _files_of_axes(self) -> list[str]:
        """Return a comment with the files of this name but another number: one file a joint."""
        path, named = self.reading.path, _FILE_OF_AXIS.fullmatch(self.reading.path.stem)
        files = sorted(path.parent.glob(f"*{path.suffix}"))[: CHOICE.most_files]
        if named is not None:
            pattern = re.compile(rf"{re.escape(named[1])}\d+{re.escape(named[3])}")
            files = [file for file in files if file != path and pattern.fullmatch(file.stem)]
        listed = ", ".join(clean(file.name, 40) for file in files[:8]) if named else ""
        line = (
            f"    # one file a joint? beside this one are {listed}: join them, one column a joint"
        )
        return [line] if listed else []

    def _held(self) -> str:
        """Return `torque = …`: by the name of its columns, else by whether it is held."""
        group, tau, q = self.reading.tau.group, self.found.tau, self.found.q
        column = f"column '{clean(group.columns[0], 40)}'" if group else ""
        if group is None or tau is None:
            why = 'the torque is open; "held-command" where the drive was commanded'
            guess = Guess("measured", "unsure", why)
        elif group.origin == "commanded":
            guess = Guess("held-command", "likely", f"{column} is named a command")
        elif self.found.current:
            guess = Guess("measured", "likely", "a current is sampled like the position")
        elif group.origin == "measured":
            guess = Guess("measured", "sure", f"{column} is named a measurement")
        else:
            guess = held(tau, q if q is not None else tau)
        return f'torque = "{guess.value}"   {self.note("torque", guess)}'

    def _time(self) -> list[str]:
        """Return [time]: a column, or the rate that the file states or a velocity shows."""
        clock, found = self.reading.clock, self.found
        known, rate = math.isfinite(found.rate), f'rate = "{BLANK}"   # Hz'
        if known:
            rate = f"rate = {found.rate:g}   {self.note('rate', found.rate_guess)}"
        if clock is None:
            why = found.rate_guess.why or "no column rises steadily, so only you know it"
            return [rate if known else f"{rate}; {clean(why, 200)}"]
        note = self.note("time unit", found.clock)
        if clock.paired:
            columns, units = (", ".join(map(_quoted, x)) for x in (clock.columns, clock.units))
            return [f"column = [{columns}]", f"unit = [{units}]   {note}"]
        unit = found.clock.value or BLANK
        lines = [f"column = {_quoted(clock.columns[0])}", f'unit = "{unit}"   {note}']
        return [*lines, rate] if unit == "sample" else lines

    def _map_hint(self) -> list[str]:
        """Return a hint where positions rise in even steps without a clock: no motion, a map."""
        group, q = self.reading.q.group, self.found.q
        clocked = self.reading.clock is not None or math.isfinite(self.found.rate)
        if clocked or group is None or q is None or q.shape[1] != 1:
            return []
        steps = np.diff(q[:, 0])
        rising = steps.size >= EVIDENCE.map_least and ((steps > 0).all() or (steps < 0).all())
        if not rising or np.std(steps) > EVIDENCE.map_even * abs(np.mean(steps)):
            return []
        name, file = clean(group.columns[0], 40), _quoted(self.reading.path.name)
        return [
            f"# check: likely a map and no log, {name} goes on in even steps of "
            f"{np.mean(steps):.4g}; then delete [log], [time] and [signals], and write",
            f"#     [[table]] match = {file}, columns = {{ q = {{ column = …, unit = … }} }}",
        ]

    def _position(self) -> list[str]:
        choice, table, q = self.reading.q, self.reading.table, self.found.q
        why_not = _doubt(self.found, "q")
        if choice.group is None or q is None or why_not is not None:
            return self._open("q", choice, why_not)
        columns, units = _columns(choice.group.columns, table), _units(self.found.q_units)
        lines = [f"q = {{ {columns}, unit = {units}{self.found.q_keys} }}"]
        lines += [f"    {self.note('q unit', guess)}" for guess in self.found.q_guesses]
        return [*lines, *self._about(choice, table)]

    def _about(self, choice: Choice, table: RawTable) -> list[str]:
        """Return comments: a stated unit, the order of the joints, the other candidates."""
        group, lines = choice.group, []
        if group is None:
            return []
        said = statement(self.found, group, False, table)
        if said is not None and None in own_units(group.columns, table):
            contrary = "" if said.value else "contradictory, "
            lines.append(f"    # check: {contrary}the file states {clean(said.words, 200)}")
        if gripper := ", ".join(clean(column, 40) for column in group.gripper):
            lines.append(f"    # left out, a gripper's by the file's names: {gripper}")
        if group.order == "file" and len(group.columns) > 1:
            lines.append("    # check: joints in the order of the file, from the base to the tip")
        for other in [other for other in choice.others[:6] if not other.partial]:
            words = f"{other.words} ({other.quantity}, {other.origin})"
            lines.append(f"    # also there: {words}, {_columns(other.columns, table)}")
        return lines

    def _velocity(self) -> list[str]:
        """Return the line of a velocity that is the slope of the position; else a comment."""
        group, table, found = self.reading.dq.group, self.reading.table, self.found
        position, slope = self.reading.q.group, found.slope
        if group is None:
            return []
        unit, columns = "", _columns(group.columns, table)
        if slope is not None and found.t is not None and position is not None:
            ordered = not _out_of_order(found, group) and position.order == group.order
            turning = all(joint.type == "revolute" for joint in found.joints)
            if turning and ordered and _doubt(found, "q") is None:
                of_q = UNITS.get(found.q_units[0])
                size = of_q.factor * slope.factor if of_q else math.nan
                named = named_units(found, group, table)[0]
                off = {speed: abs(size / UNITS[speed].factor - 1.0) for speed in _SPEEDS}
                near = (speed for speed in _SPEEDS if off[speed] <= EVIDENCE.same_ratio)
                fits = (u for u in near if not named or UNITS.get(named) == UNITS[u])
                unit = next(fits, "")
        if not unit or slope is None:
            return [f"    # left out: {group.words} (velocity), {columns}"]
        why = f"the position's slope is {slope.factor:.4g} times it"
        guess = Guess(unit, "likely", f"{why}; remove the line where it was not measured")
        line = f"dq = {{ {columns}, unit = {_quoted(unit)} }}"
        return [line, f"    {self.note('dq unit', guess)}"]

    def _torque(self) -> list[str]:
        choice, table, found = self.reading.tau, self.reading.torque_table, self.found
        why_not, sign = _doubt(found, "tau"), found.sign
        if choice.group is None or found.tau is None or why_not is not None:
            return self._open("tau", choice, why_not)
        further = self._file(table)
        if found.tau_scale:
            further += f", scale = {found.tau_scale.number:g}"
        if sign.value != "as recorded":
            further += f', sign = "{BLANK}"' if "?" in sign.value else f", sign = {sign.value}"
        columns = _columns(choice.group.columns, table)
        lines = [f"tau = {{ {columns}, unit = {_units(found.tau_units)}{further} }}"]
        lines += [f"    {self.note('tau unit', found.tau_guess)}", *self._about(choice, table)]
        return [*lines, *([f"    {self.note('sign', sign)}"] if sign.why else [])]

    def _open(self, signal: str, choice: Choice, doubt: str | None) -> list[str]:
        """Return a blank line with the candidates, and why none of them was taken."""
        table = self.reading.torque_table if signal == "tau" else self.reading.table
        lines = [f'{signal} = {{ columns = "{BLANK}", unit = "{BLANK}" }}']
        found = choice.opened.others
        if not found:
            items = list(table.text.items())[:5]
            other = ", ".join(f"{clean(name, 40)} ({clean(text, 80)})" for name, text in items)
            lines[0] += "   # no column looks like it"
            lines[0] += ", and a log needs a torque" if signal == "tau" else ""
            lines += [f"    # no columns of numbers: {other}"] if other else []
        lines += [f"    # {doubt}"] if doubt else []
        if found and all(group.origin == "commanded" for group in found):
            lines.append("    # named commands, or the points of a plan: what was measured?")
        for group in found[:8]:
            first = group is choice.group and not doubt
            ask = "write them from the base to the tip" if first else "candidate"
            lines.append(f"    # {ask}: {_columns(group.columns, table)}{self._file(table)}")
        if found and (beside := [f"file = {_quoted(name)}" for name in self.reading.beside[:8]]):
            return [*lines, f"    # as many columns and rows: {', '.join(beside)}"]
        return [*lines, *(self._other_files() if signal == "tau" else ())]

    def _file(self, table: RawTable) -> str:
        return f", file = {_quoted(table.source)}" if table is not self.reading.table else ""

    def _other_files(self) -> list[str]:
        """Return a comment with files of this folder whose names differ in more than numbers."""
        path = self.reading.path
        near = [p for p in sorted(path.parent.iterdir())[: CHOICE.most_files] if p.is_file()]
        names = [p.name for p in near if p.suffix == path.suffix and p.name[0] != "."]
        alike = re.sub(r"\d+", "#", path.name)
        others = [_quoted(name) for name in names if re.sub(r"\d+", "#", name) != alike]
        files = " or ".join(others[:4])
        return [f"    # if the torques are in another file: file = {files}"] if others else []

    def _drive(self) -> list[str]:
        """Return [drive]: a blank where positions are the motors', else a comment.

        Stated gear ratios and torque constants are quoted for a person to confirm.
        """
        notes, n, current = self.reading.table.notes, self.reading.joints, self.found.current
        gear, of_motors = stated_gear(notes), self.found.of_motors
        where = "of motors, by name, note or start" if of_motors else "where numbers are motor side"
        lines = [f"{'' if of_motors or current else '# '}[drive]   # {where}: {_MOTORS}"]
        if of_motors:
            ratio = f'transmission = "{BLANK}"   # gear ratio of each joint; '
            lines.append(f"{ratio}remove it where they are the joints'")
        if gear is not None:
            ratios = f": transmission = [{', '.join([f'{gear.number:g}'] * n)}]" * bool(gear.value)
            said = f"'{clean(gear.words.strip(chr(39)), 200)}'"
            lines.append(f"# the file states {said}{ratios}, + where motor and joint turn alike")
        elif not of_motors:
            lines.append(f"# transmission = [{', '.join(['100.0'] * n)}]")
        if current:
            said_of = [note.strip("# ") for note in notes if _TORQUE_CONSTANT.search(note)][:3]
            lines += [f"# the file states '{clean(line, 200)}'" for line in said_of]
            constant = f'torque_constant = "{BLANK}"'
            lines.append(f"{constant}             # N m/A, motor side: from the data sheet")
        return lines

    def _missing(self) -> list[str]:
        """Return [missing] with what marks a lost sample: numbers, rows of zeros; or nothing."""
        lines, lost, rows = [], list(self.reading.lost), self.reading.lost_rows
        if lost:
            guess = Guess(str(lost), "likely", "far from all other numbers of its column")
            lines.append(f"values = {lost}   {self.note('missing', guess)}")
        if rows:
            why = f"{rows} are zero in all that was measured, far from those around"
            guess = Guess("rows of zeros", "likely", why)
            lines.append(f"rows = [0.0]   {self.note('missing', guess)}")
        return ["[missing]", *lines, ""] if lines else []

    def _resample(self) -> list[str]:
        if self.found.t is None:
            return []
        steps, median = np.diff(self.found.t), median_step(self.found.t)
        uneven = float(np.percentile(np.abs(steps - median), 95)) / median
        if uneven < EVIDENCE.even:
            even = f"time is even within {100 * uneven:.2g} %, every {1e3 * median:.6g} ms"
            return [f"# {even}: nothing to resample"]
        rate = round_rate(1.0 / median)
        why = f"steps of {1e3 * steps.min():.4g} to {1e3 * steps.max():.4g} ms, median "
        why += f"{1e3 * median:.4g} ms: the next round rate below, so that no sample is invented"
        note = self.note("resample", Guess(f"{rate:g} Hz", "likely", why))
        return ["[resample]", f"rate = {rate:g}   {note}", 'method = "spline"']


def _out_of_order(found: Findings, group: Group) -> bool:
    """Return whether the joints' order is open: foreign words, in no order from the base."""
    if group.order != "file" or len(group.columns) == 1 or found.reading.by_evidence:
        return group.order == "text"
    lower, parts = [column.lower() for column in group.columns], list(enumerate(_BASE_TO_TIP))
    ranks = [next((k for k, part in parts if part in name), -1) for name in lower]
    return -1 in ranks or ranks != sorted(ranks) or lower == sorted(lower)


def _doubt(found: Findings, signal: str) -> str | None:
    """Return why the columns of a signal are left open, "" without a reason; None otherwise.

    A word that the other signal's names have not may say more, unless a velocity or the robot's
    links confirm it.
    """
    pair = found.reading.q.group, found.reading.tau.group
    (group, other), links = pair if signal == "q" else pair[::-1], found.links
    if group is None or _out_of_order(found, group):
        return ""
    confirmed = links is not None and links.followed and not links.alone
    words = group.unknown - (other.unknown if other else frozenset())
    if words and not (signal == "tau" and confirmed):
        return f"what does '{clean(min(words), 40)}' say of it?"
    best = min(found.fits.values(), key=lambda fit: fit.unexplained, default=None)
    for fit in (links, found.fits.get(NAMED, best)):
        if fit is not None and fit.otherwise:
            return f"the robot's own links agree far better with {fit.otherwise}"
    if links is None:
        return None
    named = any(named_units(found, group, found.reading.torque_table))
    if not links.followed and (signal == "q" or not named):
        disagree = "torque and motion do not agree by the robot's own links"
        return f"{disagree}: other torques, or the order, unit or zero of the joints?"
    if links.alone and signal == "tau" and group.origin == "plain":
        asked = "without friction: computed, or simulated?"
        return f"it is what the robot's own links ask for, {asked}"
    return None


def _units(units: Sequence[str]) -> str:
    """Return the unit in TOML: one text, or one a joint; FILL IN where one is open."""
    words = [_quoted(unit or BLANK) for unit in units]
    return words[0] if len(set(words)) == 1 else f"[{', '.join(words)}]"


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
