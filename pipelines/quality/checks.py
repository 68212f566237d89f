"""The log doctor: named checks of one log, and of several together.

    for check in check_log(log):  ...       one `Check` for everything that was looked at, found or not
    for check in check_together(subjects):  what only several logs show: copies, names, one-way friction logs

A check that finds nothing says so with level "ok" and what it measured, so that a reader sees what was looked at.
Codes are rows of the table of bad inputs; D16 (a joint moves that the experiment holds) and S21 (two logs of a folder
have one name) are two more.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from typing import Final

from pipelines.errors import Check
from pipelines.io.experiment import ExperimentLog
from pipelines.io.files import Opened
from pipelines.quality.checks_motion import MOTION_CHECKS, both_ways
from pipelines.quality.checks_pace import PACE_CHECKS
from pipelines.quality.checks_signal import SIGNAL_CHECKS
from pipelines.quality.checks_subject import NotTested, Subject
from pipelines.quality.checks_time import CLOCK_CHECKS, MOTION_BAND, TIME_CHECKS
from pipelines.quality.checks_unit import UNIT_CHECKS

__all__ = ["CHECKS", "LogCheck", "NotTested", "Subject", "check_log", "check_together", "findings"]

LogCheck = Callable[[Subject], Sequence[Check | NotTested]]

CHECKS: Final[tuple[LogCheck, ...]] = (*TIME_CHECKS, *PACE_CHECKS, MOTION_BAND, *UNIT_CHECKS, *SIGNAL_CHECKS, *MOTION_CHECKS)


# What follows from an input that is rejected for another reason is not worth a word of its own.
_CONSEQUENCES: Final = {
    "RRID-D04": ("D11", "S16"),
    "RRID-S05": ("D05", "D06"),
    "RRID-S07": ("D06", "D08", "D11", "D12", "D16", "S15", "S16"),
    "RRID-S08": ("T03", "T04", "T05", "T07", "T09", "D11", "D12"),
    "RRID-S09": ("T03", "T04", "T05", "T07", "T09", "D11", "D12"),
}


def check_log(log: ExperimentLog | Subject, trusted: tuple[str, ...] = ()) -> tuple[Check, ...]:
    """Everything the doctor has to say about one log, but what the user vouches for: codes in `trusted`."""
    subject = log if isinstance(log, Subject) else Subject(log)
    return tuple(found for found in findings(subject, trusted) if isinstance(found, Check))


def findings(subject: Subject, trusted: tuple[str, ...] = ()) -> tuple[Check | NotTested, ...]:
    """The same, and what could not be tested."""
    if subject.log.n_samples < 2:
        return tuple(TIME_CHECKS[0](subject))
    if subject.planned:
        return ()  # a plan has neither clock nor sensors
    if not subject.good.time.advances:
        said = (found for check in CLOCK_CHECKS for found in check(subject) if isinstance(found, Check) and found.level != "ok")
        return tuple(found for found in said if found.code != "RRID-T07")  # without time nothing is shorter than a period
    checks = CHECKS if subject.sampled else TIME_CHECKS
    found = [found for check in checks for found in check(subject) if found.code not in trusted]
    follows = {f"RRID-{code}" for check in found if isinstance(check, Check) and check.level == "reject"
               for code in _CONSEQUENCES.get(check.code, ())}
    return tuple(check for check in found if (isinstance(check, Check) and check.level == "ok") or check.code not in follows)


def check_together(opened: Sequence[Opened], subjects: Sequence[Subject]) -> tuple[Check, ...]:
    """D14, D10 and names: what only several logs show."""
    return (*_leaks(opened), *_names(opened), *_one_way_friction(subjects))


def _leaks(opened: Iterable[Opened]) -> list[Check]:
    """D14: a log that a fit uses must not judge it."""
    copies: dict[str, list[Opened]] = defaultdict(list)
    for one in opened:
        copies[one.sha256].append(one)
    found = []
    for group in copies.values():
        names = ", ".join(one.path.name for one in group)
        if len(group) > 1:
            found.append(Check.of("D14", "warn",
                                  f"the same file {len(group)} times: {names}",
                                  where=group[0].path,
                                  remedy="keep one of them; a copy counts twice in a fit"))
    content: dict[bytes, list[Opened]] = defaultdict(list)
    for one in opened:
        if one.log.origin != "planned" and one.log.n_samples > 1:
            content[one.log.q.tobytes() + one.log.tau.tobytes() if one.log.n_samples < 100 else _fingerprint(one.log)].append(one)
    for group in content.values():
        roles = sorted({one.log.role for one in group})
        if len(roles) > 1:
            found.append(Check.of("D14", "reject",
                                  f"leak: {', '.join(one.path.name for one in group)} hold the same samples with roles "
                                  f"{' and '.join(roles)}",
                                  where=group[0].path, gate=True,
                                  remedy="judge on another recording; a fit always explains what it was made from"))
    return found


def _fingerprint(log: ExperimentLog) -> bytes:
    import hashlib

    return hashlib.sha256(log.q.tobytes() + log.tau.tobytes()).digest()


def _names(opened: Iterable[Opened]) -> list[Check]:
    """A log's name is unique within its folder: results are filed under it."""
    named: dict[tuple[str, str], list[Opened]] = defaultdict(list)
    for one in opened:
        named[str(one.path.parent), one.log.name].append(one)
    return [Check.of("S21", "warn",
                     f"{len(group)} logs are named '{name}': {', '.join(one.path.name for one in group)}",
                     where=folder,
                     remedy="give each log of a folder a name of its own")
            for (folder, name), group in named.items() if len(group) > 1 and len({one.sha256 for one in group}) > 1]


def _one_way_friction(subjects: Iterable[Subject]) -> list[Check]:
    """D10: all friction logs of a joint together move it both ways."""
    groups: dict[tuple[str, int], list[tuple[Subject, float, float]]] = defaultdict(list)
    for subject in subjects:
        if subject.log.experiment == "friction" and subject.sampled:
            for joint, (up, down) in both_ways(subject).items():
                groups[subject.log.robot_name, joint].append((subject, up, down))
    found = []
    for (_, joint), members in groups.items():
        if max(up for _, up, _ in members) < 0.02 or max(down for _, _, down in members) < 0.02:
            found.append(members[0][0].say("D10", "warn",
                                           f"the speed of joint {joint + 1} never changes sign in its friction logs: "
                                           f"Coulomb offset unidentifiable joint {joint + 1}",
                                           signal="q", joint=joint, gate=True,
                                           remedy="record the joint in both directions"))
    return found
