"""Draft a recipe for a recording, with the reason of every guess, for a person to correct.

Names give the columns (`roles`), headers and names the units. Where they do not, two relations of
the numbers decide: a velocity is the slope of its position, and a torque follows from the motion by
weight and inertia of the robot's own links (`links`). The same relations refute a name. What
neither decides is marked FILL IN, with the candidates; what is likely is marked "check:".
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipelines.errors import InputRejected, RrridError, clean
from pipelines.importers.clock import SECONDS
from pipelines.importers.config import CLOCK, GUESS
from pipelines.importers.links import LinkFit, TorqueModel, fit_links
from pipelines.importers.names import COMMANDED, words_of
from pipelines.importers.raw import RawTable
from pipelines.importers.recipe import BLANK, blanks_of
from pipelines.importers.roles import Clock, Group, Roles, choose, matrix
from pipelines.importers.tables import read_table
from pipelines.io.limits import FEWEST, LARGEST_JITTER, jitter
from pipelines.io.log import Array
from pipelines.io.robot import RobotDescription
from pipelines.io.robot_files import load_robot
from pipelines.io.sandbox import parse_toml
from pipelines.io.units import UNITS, canonical_unit

_ANGLES = ("rad", "deg", "rev", "mrad")
_SPEEDS = ("rad/s", "deg/s")


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


@dataclass(frozen=True)
class Guess:
    """A value, "" where it is open, and why."""

    value: str = ""
    why: str = ""
    sure: bool = False

    @property
    def comment(self) -> str:
        return f"# {'' if self.sure else 'check: '}{clean(self.why, 300)}"


@dataclass(frozen=True)
class _Units:
    """The units of position and torque, and why both signals are left open."""

    q: Guess
    tau: Guess
    doubt: str = ""


def guess_recipe(
    path: Path,
    robot: str | None = None,
    model_of: Callable[[RobotDescription], TorqueModel | None] = lambda robot: None,
) -> Draft:
    """Return a commented recipe for the recording in `path`.

    Args:
        robot: description to use instead of that in the folder of the recording.
        model_of: gives the torque of a robot's links, None where they are not known.

    Raises:
        InputRejected: the file cannot be read as a table of numbers.
    """
    table = _sound(read_table(path), path)
    files, arm, problem = _robot_beside(path.parent, robot)
    joints = [joint.name for joint in arm.joints] if arm else []
    roles = choose(table, joints, bool(COMMANDED & set(words_of(path.stem))))
    time = _time_unit(roles.clock)
    t = None
    if roles.clock is not None and time.value in UNITS:
        factor = 1.0 if len(roles.clock.columns) > 1 else UNITS[time.value].factor
        t = (roles.clock.values - roles.clock.values[0]) * factor
    units = _units(table, roles, arm, time)
    if arm is not None and t is not None and (model := model_of(arm)) is not None:
        units = _by_links(units, model, table, roles, arm, t)
    name, columns = clean(path.name, 80), ", ".join(clean(c, 40) for c in table.columns)
    size, law = f"{table.rows.size} samples", "q_motor = N q_joint, tau_joint = N^T tau_motor"
    lines = [
        f"# Drafted by `rrrid import --guess {name}`: {size}, columns {columns}.",
        *(f"# {clean(c.message, 200)}." for c in table.checks if c.level != "ok"),
        *(f"# the file says: {clean(note, 200)}" for note in table.notes[: GUESS.quoted]),
        f'# Go through every "check:" and fill in what says {BLANK}; then: '
        "rrrid import RECIPE.toml --source FOLDER",
        *("", "[robot]", *_robot_lines(files, problem, robot is not None)),
        *("", "[log]", f"match = {quoted(path.name)}   "
          '# a pattern such as "run_{number}.csv" takes many files'),
        'experiment = "free"   # check: friction | excitation | writing | frf | hold | free',
        'role = "identify"   # check: identify | validate | reference',
        _torque_kind(roles.chosen.get("tau")),
        *("", "[time]", *_time_lines(roles.clock, time)),
        *("", "[signals]", *_signal_lines("q", table, roles, units.q, units.doubt)),
        *_velocity_lines(table, roles, units, time),
        *_signal_lines("tau", table, roles, units.tau, units.doubt),
        *("", *_drive_lines(roles, law), "", *_resample_lines(t)),
    ]  # fmt: skip
    evidence = {"time unit": time, "q unit": units.q, "tau unit": units.tau}
    said = tuple(f"{what}: {guess.value or 'open'} ({'sure' if guess.sure else 'likely'}: "
                 f"{guess.why})" for what, guess in evidence.items())  # fmt: skip
    return Draft("\n".join(lines) + "\n", said)


def _sound(table: RawTable, path: Path) -> RawTable:
    """Return the rows without a hole, of the columns that mostly hold numbers.

    Raises:
        InputRejected: F16 too many columns, T08 too few samples.
    """
    if len(table.columns) > GUESS.most_columns:
        message = f"{len(table.columns)} columns: too many to guess what each is"
        remedy = "export the joints' signals alone, or write the recipe"
        raise InputRejected("F16", message, path, remedy)
    known = {c: np.isfinite(x) & (np.abs(x) < GUESS.no_number) for c, x in table.columns.items()}
    usable = [c for c, mask in known.items() if mask.mean() > GUESS.usable]
    keep = np.all([known[c] for c in usable], axis=0) & bool(usable)
    if keep.sum() < FEWEST:
        message, remedy = f"{keep.sum()} samples without a hole", "give a recording of a motion"
        raise InputRejected("T08", message, table.source, remedy)
    columns = {c: table.columns[c][keep] for c in usable}
    return replace(table, columns=columns, rows=table.rows[keep], lines=None)


def _robot_beside(
    folder: Path, named: str | None
) -> tuple[list[str], RobotDescription | None, str]:
    """Return the robots in the folder, the only one that can be read, and why it cannot."""
    if named is not None:
        return [named], load_robot(named), ""
    found: list[tuple[str, RobotDescription | None, str]] = []
    urdf = sorted(folder.glob("*.urdf"))[: GUESS.most_robots]
    for path in urdf or sorted(folder.glob("*.toml"))[: GUESS.most_robots]:
        try:
            found.append((path.name, load_robot(path), ""))
        except RrridError as problem:  # of TOML, a recipe or another file
            if urdf:
                found.append((path.name, None, f"{problem.message}. {problem.remedy}"))
    files = [name for name, *_ in found]
    return (files, *found[0][1:]) if len(found) == 1 else (files, None, "")


def _own(group: Group) -> str:
    """Return the unit that names say of all columns of a group, as `UNITS` spells it, else ""."""
    return canonical_unit(group.unit) if group.unit else ""


def _time_unit(clock: Clock | None) -> Guess:
    """Return the unit of a clock: named, by the century it counts to, or by a plausible rate."""
    if clock is None:
        return Guess("", "no column rises steadily: only you know the rate")
    if len(clock.columns) > 1:
        return Guess("s", f"whole seconds and {clock.units[1]} together rise", True)
    named = canonical_unit(clock.units[0]) if clock.units[0] else ""
    if named == "sample":
        return Guess("sample", "named a counter: the rate is not in the file")
    steps = np.diff(clock.values)
    step = float(np.median(steps[steps > 0]))
    if named:
        known = UNITS[named].factor if named in UNITS else math.nan
        plausible = CLOCK.slowest <= 1.0 / (step * known) <= CLOCK.fastest
        why = "named so" if plausible else f"named '{named}', at no rate of a robot"
        return Guess(named if plausible else "", why, plausible)
    if clock.values[0] in (0.0, 1.0) and (steps == 1.0).all():
        return Guess("", "counts 1, 2, 3, …: ms, or samples?")
    rates = {u: 1.0 / (step * f) for u, f in SECONDS.items()}
    fits = [u for u, rate in rates.items() if GUESS.slowest <= rate <= GUESS.fastest]
    since = [u for u, f in SECONDS.items() if CLOCK.from_2001 < clock.values[0] * f < CLOCK.to_2096]
    fits = [u for u in fits if u in since] or fits
    if len(fits) == 1:
        return Guess(fits[0], f"steps of {step:.6g} are {rates[fits[0]]:.6g} Hz")
    return Guess("", f"steps of {step:.6g}: {' or '.join(fits) or 'no usual unit'}")


def _units(table: RawTable, roles: Roles, arm: RobotDescription | None, time: Guess) -> _Units:
    """Return the units that names say and the recorded velocity does not refute, or proves."""
    q, dq, tau = (roles.chosen.get(signal) for signal in ("q", "dq", "tau"))
    step = SECONDS.get(time.value, math.nan)
    slope = (roles.slope or math.nan) / step  # q over dq, a second
    position = Guess()
    if q is not None:
        speed = UNITS.get(_own(dq)) if dq else None
        position = _of_position(q, table, arm, speed.factor / slope if speed else math.nan)
    own = _own(tau) if tau else ""
    why = "named so" if own in UNITS else f"named '{own}'" * bool(own)
    return _Units(position, Guess(own if own in UNITS else "", why, own in UNITS))


def _near(size: float, units: tuple[str, ...]) -> list[str]:
    """Return which of `units` is `size` in SI; none of nan."""
    return [u for u in units if abs(size / UNITS[u].factor - 1.0) < GUESS.same_ratio]


def _of_position(group: Group, table: RawTable, arm: RobotDescription | None, size: float) -> Guess:
    """Return the unit of positions: named, or of `size` in SI, as the recorded velocity says."""
    named = _own(group)
    if named not in UNITS:
        near = _near(size, _ANGLES)
        if named or not near:
            return Guess(named if named == "counts" else "", f"named '{named}'" * bool(named))
        return Guess(near[0], "the recorded velocity is the slope of the position")
    factor = UNITS[named].factor
    if abs(size / factor - 1.0) > GUESS.same_ratio:  # False for nan
        return Guess("", f"named '{named}', but the recorded velocity is not its slope")
    spans = np.ptp(matrix(table, group), axis=0).tolist()
    for span, joint in zip(spans, arm.joints if arm else (), strict=False):
        low, high = joint.position
        if span * factor > GUESS.twice_room * (high - low):
            why = f"its name or header says '{named}', but joint '{joint.name}' would move over"
            return Guess("", f"{why} {span:.4g} {named}, beyond its limits")
    return Guess(named, "named so", True)


def _by_links(
    units: _Units,
    model: TorqueModel,
    table: RawTable,
    roles: Roles,
    arm: RobotDescription,
    t: Array,
) -> _Units:
    """Take or refute units by what the robot's own links ask for."""
    q, tau = (roles.chosen.get(signal) for signal in ("q", "tau"))
    angles = units.q.value in _ANGLES or not (units.q.value or units.q.why)
    if q is None or tau is None or not angles or q.name.motor or tau.name.motor:
        return units
    if not all(joint.revolute for joint in arm.joints):
        return units
    fits: dict[str, LinkFit] = {}
    for unit in dict.fromkeys(("rad", "deg", units.q.value or "rad")):
        fit = fit_links(model, matrix(table, q) * UNITS[unit].factor, t, matrix(table, tau))
        fits |= {} if fit is None else {unit: fit}
    return _judged(units, fits, tau) if fits else units


def _judged(units: _Units, fits: dict[str, LinkFit], tau: Group) -> _Units:
    """Take or refute units by the fit of the torque under each unit of position."""
    best = min(fits, key=lambda unit: fits[unit].unexplained)
    own = fits.get(units.q.value or best, fits[best])
    if min(own.unexplained, fits[best].unexplained) > GUESS.refutes:
        doubt = "torque and motion do not agree by the robot's own links: other torques, "
        return replace(units, doubt=f"{doubt}or the order, unit or zero of the joints?")
    named = UNITS.get(units.tau.value)
    most = GUESS.gain if named else GUESS.unnamed_gain

    def near(fit: LinkFit) -> bool:  # as large as the links' torque, in N m
        gains = fit.gains * (named.factor if named else 1.0)
        return gains.size > 0 and bool(((gains > 1.0 / most) & (gains < most)).all())

    # Gears near 57 make radians of a motor look like degrees of a joint, but for the torque.
    worse = [GUESS.better * fit.unexplained for name, fit in fits.items() if name != best]
    proved = fits[best].unexplained < min(GUESS.proves, *worse, 1.0)
    proved &= best == "rad" or near(fits[best])
    follows = "the torque follows from the motion by the robot's links"
    position, torque, doubt = units.q, units.tau, ""
    if proved and not position.value and not position.why:
        position = Guess(best, f"{follows} in {best}")
    elif proved and position.value not in ("", best):
        position = Guess("", f"says '{position.value}', but {follows} if it is in {best}")
    own = fits.get(position.value, own)
    if tau.name.quantity != "torque":
        return replace(units, q=position)
    if not near(own):
        why = f"{np.round(own.gains, 3).tolist()} times what weight and inertia of the robot's "
        torque = Guess("", f"{why}links ask for: another unit or sign, or the motor's side?")
    elif proved and position.value and not _own(tau):
        torque = Guess("N m", f"{follows} in N m")
    elif torque.value and not proved:
        share = f"{100.0 * (1.0 - own.unexplained):.0f} %"
        why = f"named so, but the robot's links explain {share} of it: order, zero, side?"
        torque = replace(torque, why=why, sure=False)
    if tau.name.origin == "commanded" and not proved:
        doubt = "the command is not the torque that the robot's own links ask for"
    return replace(units, q=position, tau=torque, doubt=doubt)


def _robot_lines(files: list[str], problem: str, named: bool) -> list[str]:
    if len(files) != 1:
        listed = ", ".join(clean(file, 40) for file in files)
        return [f'use = "{BLANK}"   # the robot: {listed or "a TOML, a URDF, or a shipped name"}']
    why = "as --robot says" if named else "check: likely, it lies in the same folder"
    lines = [f"use = {quoted(files[0])}   # {why}"]
    lines += [f"# {clean(problem, 300)}"] if problem else []
    return [*lines, *([f'tip_link = "{BLANK}"'] if "tip_link" in problem else [])]


def _torque_kind(group: Group | None) -> str:
    """Return whether the torque is a held command or sampled, by the name of its columns."""
    if group is None or (group.name.origin == "plain" and group.name.quantity != "current"):
        why = "check: unsure, nothing says it; held-command where the drive was commanded"
        return f'torque = "measured"   # {why}'
    if group.name.origin == "commanded":
        return 'torque = "held-command"   # check: likely, it is named a command'
    return 'torque = "measured"   # named so, or a current, which is sampled like the position'


def _time_lines(clock: Clock | None, unit: Guess) -> list[str]:
    if clock is None:
        return [f'rate = "{BLANK}"   # Hz; {clean(unit.why, 200)}']
    if len(clock.columns) > 1:
        columns, units = (", ".join(map(quoted, x)) for x in (clock.columns, clock.units))
        return [f"column = [{columns}]", f"unit = [{units}]   {unit.comment}"]
    lines = [f"column = {quoted(clock.columns[0])}"]
    lines += [f'unit = "{unit.value or BLANK}"   {unit.comment}']
    return [*lines, *([f'rate = "{BLANK}"   # Hz'] if unit.value == "sample" else [])]


def _velocity_lines(table: RawTable, roles: Roles, units: _Units, time: Guess) -> list[str]:
    """Return the line of a velocity that is the slope of the position, and says no other unit."""
    if (group := roles.chosen.get("dq")) is None:
        return []
    columns, unit = columns_of(group, table), ""
    if units.q.value in UNITS and time.value in SECONDS and roles.slope and not units.doubt:
        size = roles.slope * UNITS[units.q.value].factor / SECONDS[time.value]
        near, named = _near(size, _SPEEDS), _own(group)
        unit = next((u for u in near if named in ("", u)), "" if near else named)
    if not unit:
        return [f"    # left out, a velocity: {columns}"]
    why = "check: the slope of the position; remove the line where it was not measured"
    return [f"dq = {{ {columns}, unit = {quoted(unit)} }}   # {why}"]


def _signal_lines(signal: str, table: RawTable, roles: Roles, unit: Guess, doubt: str) -> list[str]:
    """Return the line of `signal`, why it is so, and what else it could be."""
    group, others = roles.chosen.get(signal), roles.others.get(signal, ())
    doubt = doubt or _unexplained(signal, roles)
    if group is None or doubt:
        candidates = (*((group,) if group else ()), *others)
        lines = [f'{signal} = {{ columns = "{BLANK}", unit = "{BLANK}" }}']
        lines += [f"    # {doubt or 'no column looks like it'}"] if doubt or not candidates else []
        if candidates and all(g.name.origin == "commanded" for g in candidates):
            lines.append("    # named commands, or the points of a plan: what was measured?")
        lines += [f"    # candidate: {columns_of(g, table)}" for g in candidates[: GUESS.shown]]
        if not candidates and table.text:
            text = ", ".join(f"{clean(k, 40)} ({clean(v, 80)})" for k, v in table.text.items())
            lines.append(f"    # no columns of numbers: {clean(text, 300)}")
        return lines
    each = [unit.value] * len(group.columns)
    if not unit.value and not unit.why:  # a unit for each joint, as far as it is named
        each = [canonical_unit(u) if canonical_unit(u) in UNITS else "" for u in group.units]
    words = [quoted(u or BLANK) for u in each]
    said = words[0] if len(set(words)) == 1 else f"[{', '.join(words)}]"
    more = f', counts_per_rev = "{BLANK}"' if unit.value == "counts" else ""
    motors = [g.name.motor for g in roles.chosen.values()]
    more += ', side = "joint"' if any(motors) and not group.name.motor else ""
    lines = [f"{signal} = {{ {columns_of(group, table)}, unit = {said}{more} }}"]
    lines.append(f"    {unit.comment if unit.why else '# no name says the unit'}")
    if group.order == "the file" and len(group.columns) > 1:
        lines.append("    # check: joints in the order of the file, from the base to the tip")
    return lines + [f"    # also there: {columns_of(g, table)}" for g in others[: GUESS.shown]]


def _unexplained(signal: str, roles: Roles) -> str:
    """Return which word of the columns' names may say more; "" for none.

    A word that position and torque both have is a name of the robot, or of the recorder.
    """
    group, other = (roles.chosen.get(s) for s in ("q", "tau")[:: 1 if signal == "q" else -1])
    if group and group.order == "words":
        return "in which order are these joints, from the base to the tip?"
    known = set(other.name.unknown if other else ())
    words = {word for word in (group.name.unknown if group else ()) if word[1:]} - known
    return f"what does '{clean(min(words), 40)}' say of it?" if words else ""


def _drive_lines(roles: Roles, law: str) -> list[str]:
    motor = any(group.name.motor for group in roles.chosen.values())
    tau = roles.chosen.get("tau")
    current = tau is not None and tau.name.quantity == "current"
    ratios = "gear ratio of each joint; remove it where the numbers are the joints'"
    lines = [f"{'' if motor or current else '# '}[drive]   # where numbers are motor side: {law}"]
    lines += [f'transmission = "{BLANK}"   # {ratios}'] if motor else []
    constant = f'torque_constant = "{BLANK}"   # N m/A, motor side: from the data sheet'
    return [*lines, *([constant] if current else [])]


def _resample_lines(t: Array | None) -> list[str]:
    """Return [resample] where the clock is uneven, at the next round rate below."""
    if t is None:
        return []
    steps = np.diff(t)
    median = float(np.median(steps[steps > 0]))
    if jitter(steps / median)[0] <= LARGEST_JITTER:
        return [f"# time is even, every {1e3 * median:.6g} ms: nothing to resample"]
    decade = 10.0 ** math.floor(math.log10(1.0 / median))
    rate = max(m for m in GUESS.round_rates if m * decade * median <= 1.0 + 1e-9) * decade
    why = f"steps of {1e3 * steps.min():.4g} to {1e3 * steps.max():.4g} ms"
    return ["[resample]", f"rate = {rate:g}   # check: {why}", 'method = "spline"']


def columns_of(group: Group, table: RawTable) -> str:
    """Return columns = "q_{j}" where the names count from 1 to the table's last, else a list."""
    names = group.columns
    if len(names) == 1:
        return f"column = {quoted(names[0])}"
    before, one, after = names[0].rpartition("1")
    counted = [f"{before}{j}{after}" for j in range(1, len(names) + 2)]
    if one and counted[:-1] == list(names) and counted[-1] not in table.columns:
        return f"columns = {quoted(f'{before}{{j}}{after}')}"
    return f"columns = [{', '.join(map(quoted, names))}]"


def quoted(text: str) -> str:
    """Return a text as TOML writes it."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
