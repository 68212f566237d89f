"""Draft a recipe for a recording, with the evidence for every guess, so that a person can correct it in a minute.

The draft says what each number rests on: a name, a range, the agreement of a velocity with the slope of a position,
jumps of one size, the sign of the power. What nothing in the file can tell is marked FILL IN; what is only likely is
marked "check:".
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipelines.errors import InputRejected, clean
from pipelines.log.experiment import Array
from pipelines.log.limits import FEWEST
from pipelines.log.recording.clock import plausible_units
from pipelines.log.recording.column_roles import companion_of, named_unit, roles_of
from pipelines.log.recording.evidence import (
    Guess,
    held,
    motion_of,
    position_unit,
    quarter_turns,
    sign_of,
    torque_unit,
)
from pipelines.log.recording.raw import RawTable
from pipelines.log.recording.recipe_reader import BLANK
from pipelines.log.recording.sources import read_table

__all__ = ["Draft", "guess_recipe"]

_NO_NUMBER = 1e20  # nanoseconds since 1970 are 2e18


@dataclass(frozen=True)
class Draft:
    """A recipe to be checked by a person, and what it rests on."""

    text: str
    evidence: tuple[str, ...]
    blanks: tuple[str, ...]  # what must be filled in before it runs


def guess_recipe(path: Path) -> Draft:
    """A commented recipe for the recording in `path`, its companions in the same folder looked for as well.

    Raises:
        InputRejected: the file cannot be read as a table of numbers.
    """
    table = _sound(read_table(path))
    roles = roles_of(table, path)
    both = "q" in roles and ("tau" in roles or "current" in roles)
    companion = None if both else companion_of(path, table)
    companion = _sound(companion) if companion is not None else None
    if companion is not None and not np.array_equal(companion.rows, table.rows):
        companion = None
    if companion is not None and "q" not in roles:
        table, companion, path = companion, table, path.parent / companion.source
        roles = roles_of(table, path)
    return _Drafting(path, table, roles, companion).draft()


def _sound(table: RawTable) -> RawTable:
    """The table without what a guess would stumble over: rows with a hole or an absurd number, columns of nothing else."""
    usable = {name: np.isfinite(values) & (np.abs(values) < _NO_NUMBER) for name, values in table.columns.items()}
    columns = {name: values for name, values in table.columns.items() if usable[name].mean() > 0.8}
    keep = np.all([usable[name] for name in columns], axis=0) if columns else np.zeros(0, dtype=bool)
    if keep.sum() < FEWEST:
        raise InputRejected("T08", f"{int(keep.sum())} samples without a hole", where=table.source,
                            remedy="give a recording of a motion")
    return replace(table, columns={name: values[keep] for name, values in columns.items()}, rows=table.rows[keep],
                   lines=None if table.lines is None else table.lines[keep])


class _Drafting:
    """Collects the lines of a draft. Not frozen: it is the pencil, the `Draft` is the result."""

    def __init__(self, path: Path, table: RawTable, roles: dict[str, tuple[str, ...]], companion: RawTable | None) -> None:
        self.path, self.table, self.roles, self.companion = path, table, roles, companion
        self.evidence: list[str] = []
        self.blanks: list[str] = []
        q = roles.get("q", ())
        torque = roles.get("tau") or roles.get("current") or ()
        self.n = len(q) or len(torque) or 1
        self.torque_table = companion if companion is not None and not torque else table
        self.torque = torque or (tuple(companion.columns)[: self.n] if companion is not None else ())
        self.ratios: dict[int, int] = {}  # joint (from 0) -> gear ratio, where the positions show one
        self.current = "tau" not in roles and "current" in roles

    def note(self, what: str, guess: Guess) -> str:
        """The comment behind a guessed value: confidence, evidence, and what to check."""
        self.evidence.append(f"{what}: {guess.value} ({guess.confidence}: {guess.why})")
        return f"# {'check: ' if guess.confidence != 'sure' else ''}{guess.confidence}, {guess.why}"

    def blank(self, what: str) -> str:
        self.blanks.append(what)
        return BLANK

    def draft(self) -> Draft:
        name = clean(self.path.name, 80)
        columns = ", ".join(clean(c, 40) for c in self.table.columns)
        lines = [f"# Drafted by `rrrid import --guess {name}`: {self.table.rows.size} samples, columns {columns}.",
                 f"# Go through every \"check:\" and fill in what says {BLANK}; then: rrrid import RECIPE.toml --source FOLDER",
                 ""]
        lines += [*self._robot(), *self._log(), *self._time(), *self._signals(), *self._drive(), *self._resample()]
        return Draft("\n".join(lines) + "\n", tuple(self.evidence), tuple(self.blanks))

    def _robot(self) -> list[str]:
        urdf = next(iter(sorted(self.path.parent.glob("*.urdf"))), None)
        if urdf is not None:
            return ["[robot]", f"use = {_quoted(urdf.name)}   # check: likely, the URDF beside the recording", ""]
        if self.n == 1:
            return ["[robot]                                 # check: one joint on a vertical axis, where gravity does no work",
                    'name = "one-joint"', "gravity = [0.0, 0.0, -9.81]", "", "[robot.kinematics]", 'convention = "dh"', "",
                    "[[robot.joint]]",
                    'name = "joint"', 'type = "revolute"', "a = 0.0", "alpha = 0.0", "d = 0.0", "offset = 0.0", ""]
        return ["[robot]",
                f'use = "{self.blank("robot.use")}"   # the robot of {self.n} joints: robot.toml, a URDF, or a shipped name', ""]

    def _log(self) -> list[str]:
        return ["[log]", f"match = {_quoted(self.path.name)}      # a pattern such as \"run_{{number}}.csv\" takes many files",
                'experiment = "free"                     # check: friction | excitation | writing | frf | hold | free',
                'role = "identify"                       # check: identify | validate | reference',
                self._held(), ""]

    def _held(self) -> str:
        """`torque = …`: by the name of its columns, else by whether it is held over samples."""
        name = next((c for c in self.torque if re.search(r"cmd|command|setpoint|soll|desired|target", c.lower())), None)
        if not self.torque:
            guess = Guess("measured", "unsure", 'no column of torque was found; "held-command" where the drive was commanded')
        elif self.current:
            guess = Guess("measured", "likely", "a current is sampled like the position")
        elif name is not None:
            guess = Guess("held-command", "likely", f"column '{clean(name, 40)}' is named a command")
        else:
            q = self.roles.get("q", ())
            tau = np.column_stack([self.torque_table.columns[c] for c in self.torque])
            guess = held(tau, np.column_stack([self.table.columns[c] for c in q]) if q else tau)
        return f'torque = "{guess.value}"   {self.note("torque", guess)}'

    def _time(self) -> list[str]:
        if "t" not in self.roles:
            self.evidence.append("rate: no column of time")
            self.blanks.append("time.rate")
            lines = ["[time]", f'rate = "{BLANK}"                        # Hz; no column rises steadily, so only you know it']
            return [*lines, *self._map_hint(), ""]
        column = self.roles["t"][0]
        guess = self._time_unit(column)
        return ["[time]", f"column = {_quoted(column)}", f"unit = \"{guess.value}\"   {self.note('time unit', guess)}", ""]

    def _map_hint(self) -> list[str]:
        """Positions that rise in even steps without a clock are a map rather than a motion."""
        q = self.roles.get("q", ())
        steps = np.diff(self.table.columns[q[0]]) if len(q) == 1 else np.zeros(0)
        if steps.size < 10 or not ((steps > 0).all() or (steps < 0).all()) or np.std(steps) > 0.2 * abs(np.mean(steps)):
            return []
        self.evidence.append("positions rise in even steps without a clock: a map")
        return [f"# check: likely a map and no log, {clean(q[0], 40)} goes on in even steps of {np.mean(steps):.4g};",
                "#     then delete [log], [time] and [signals], and write",
                f"#     [[table]] match = {_quoted(self.path.name)}, columns = {{ position = {{ column = …, unit = … }}, … }}"]

    def _time_unit(self, column: str) -> Guess:
        steps = np.diff(self.table.columns[column])
        median = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
        rate = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
        named = named_unit(column, self.table)
        fits = [unit for unit in plausible_units(median) if 10.0 <= 1.0 / (median * rate[unit]) <= 2e4] or plausible_units(median)
        if named in rate and named in fits:
            return Guess(named, "sure", f"named so, and a median step of {median:.4g} makes {1 / (median * rate[named]):.4g} Hz")
        if len(fits) == 1:
            return Guess(fits[0], "likely",
                         f"a median step of {median:.4g} makes {1 / (median * rate[fits[0]]):.4g} Hz; every other unit is absurd")
        best = fits[0] if fits else self.blank("time.unit")
        return Guess(best, "unsure", f"a median step of {median:.4g} could be {', '.join(fits) or 'a sample index'}")

    def seconds(self) -> Array | None:
        if "t" not in self.roles:
            return None
        column = self.roles["t"][0]
        factor = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}.get(self._time_unit(column).value, 1.0)
        return self.table.columns[column] * factor

    def _signals(self) -> list[str]:
        lines = ["[signals]"]
        q = self.roles.get("q", ())
        if q:
            values = np.column_stack([self.table.columns[c] for c in q])
            dq = self.roles.get("dq", ())
            speed = np.column_stack([self.table.columns[c] for c in dq]) if len(dq) == len(q) else None
            named = named_unit(q[0], self.table)
            guess, extra = position_unit(values, self.seconds(), speed, named)
            self.ratios = quarter_turns(values) if guess.value == "rad" and "times pi/2" in guess.why else {}
            lines += [f"q = {{ {_columns(q)}, unit = \"{guess.value}\"{extra} }}", f"    {self.note('q unit', guess)}"]
            lines += [f"    {comment}" for comment in motion_of(values, guess.value)]
        else:
            lines.append(f'q = {{ columns = "{self.blank("signals.q")}", unit = "{BLANK}" }}')
        return [*lines, *self._torque(), ""]

    def _torque(self) -> list[str]:
        if not self.torque:
            return [f'tau = {{ columns = "{self.blank("signals.tau")}", unit = "{BLANK}" }}   # no column looks like it']
        values = np.column_stack([self.torque_table.columns[c] for c in self.torque])
        named = named_unit(self.torque[0], self.torque_table)
        guess = torque_unit(values, named, self.current)
        self.current = guess.value in ("A", "mA")
        file = f", file = {_quoted(self.torque_table.source)}" if self.torque_table is not self.table else ""
        lines = [f"tau = {{ {_columns(self.torque)}, unit = \"{guess.value}\"{file} }}", f"    {self.note('tau unit', guess)}"]
        q = self.roles.get("q", ())
        if len(q) == len(self.torque):
            lines.append(f"    {self.note('sign', sign_of(np.column_stack([self.table.columns[c] for c in q]), values))}")
        return lines

    def _drive(self) -> list[str]:
        ratios = [str(abs(self.ratios[j])) + ".0" if j in self.ratios else f'"{BLANK}"' for j in range(self.n)]
        if self.ratios:
            if len(self.ratios) < self.n:
                self.blanks.append("drive.transmission")
            unknown = f"; those marked {BLANK} stood near zero: from the data sheet" if len(self.ratios) < self.n else ""
            lines = ["[drive]                  # check: likely, positions start at these numbers of quarter turns: motor side",
                     f"transmission = [{', '.join(ratios)}]   # check: sign, + where motor and joint turn alike{unknown}"]
            if self.current:
                self.blanks.append("drive.torque_constant")
                lines.append(f'torque_constant = "{BLANK}"             # N m/A, motor side: from the data sheet')
            return [*lines, ""]
        lines = ["# [drive]                # where numbers are motor side: q_motor = N q_joint, tau_joint = N^T tau_motor",
                 f"# transmission = [{', '.join(['100.0'] * self.n)}]"]
        if not self.current:
            return [*lines, ""]
        self.blanks.append("drive.torque_constant")
        return ["[drive]", f'torque_constant = "{BLANK}"             # N m/A, motor side: from the data sheet',
                f"# transmission = [{', '.join(['100.0'] * self.n)}]   # where numbers are motor side: q_motor = N q_joint", ""]

    def _resample(self) -> list[str]:
        t = self.seconds()
        if t is None:
            return []
        steps = np.diff(t)
        median = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
        uneven = float(np.percentile(np.abs(steps - median), 95)) / median
        if uneven < 0.05:
            self.evidence.append(f"time is even within {100 * uneven:.2g} %")
            return [f"# time is even within {100 * uneven:.2g} %, every {1e3 * median:.6g} ms: nothing to resample"]
        rate = _round_below(1.0 / median)
        guess = Guess(f"{rate:g} Hz", "likely",
                      f"steps of {1e3 * steps.min():.4g} to {1e3 * steps.max():.4g} ms, median {1e3 * median:.4g} ms: "
                      "the next round rate below, so that no sample is invented")
        return ["[resample]", f"rate = {rate:g}   {self.note('resample', guess)}", 'method = "spline"']


def _round_below(rate: float) -> float:
    decade = 10.0 ** np.floor(np.log10(rate))
    return float(max(m for m in (1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0) if m * decade <= rate * (1 + 1e-9)) * decade)


def _columns(names: Sequence[str]) -> str:
    """columns = "q_{j}" where the names count from 1, else a list."""
    if len(names) == 1:
        return f"column = {_quoted(names[0])}"
    pattern = re.sub(r"1(?!.*1)", "{j}", names[0])
    if "{j}" in pattern and all(pattern.replace("{j}", str(j)) == name for j, name in enumerate(names, start=1)):
        return f"columns = {_quoted(pattern)}"
    return f"columns = [{', '.join(map(_quoted, names))}]"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
