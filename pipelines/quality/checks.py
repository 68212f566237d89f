"""Run the named checks of one log, and of several together.

    for check in check_log(log):             a `Check` for each thing checked, wrong or not
    for check in check_together(logs, ...):  what only several logs show: copies, names, directions

A check that finds nothing has level "ok" and says what it measured. Codes are rows of the table of
bad inputs; D16 (a joint moves that the experiment holds) and S21 (two logs of a folder have one
name) are two more.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from hashlib import sha256
from typing import Final

from pipelines.errors import Check
from pipelines.io.files import Opened
from pipelines.io.log import ExperimentLog
from pipelines.quality.clock import CLOCK_CHECKS, ORDER_CHECKS, length
from pipelines.quality.config import CONFIG
from pipelines.quality.motion import MOTION_CHECKS, both_ways
from pipelines.quality.signals import SIGNAL_CHECKS
from pipelines.quality.subject import NotTested, Subject
from pipelines.quality.units import UNIT_CHECKS

__all__ = ["CHECKS", "LogCheck", "NotTested", "Subject", "accepted", "check_log"]
__all__ += ["check_together", "columns_first", "findings"]

LogCheck = Callable[[Subject], Sequence[Check | NotTested]]

CHECKS: Final[tuple[LogCheck, ...]] = (*CLOCK_CHECKS, *UNIT_CHECKS, *SIGNAL_CHECKS, *MOTION_CHECKS)

# What follows from an input that is rejected for another reason is left out.
_NO_TIME: Final = ("T03", "T04", "T05", "T07", "T09", "D11", "D12")
_CONSEQUENCES: Final = {
    "RRID-D04": ("D11", "S16"),
    "RRID-S05": ("D05", "D06"),
    "RRID-S07": ("D06", "D08", "D11", "D12", "D16", "S15", "S16"),
    "RRID-S08": _NO_TIME,
    "RRID-S09": _NO_TIME,
}


def check_log(log: ExperimentLog | Subject, trusted: tuple[str, ...] = ()) -> tuple[Check, ...]:
    """Return the checks of one log, but for the codes in `trusted`, which the user vouches for."""
    subject = log if isinstance(log, Subject) else Subject(log)
    return tuple(item for item in findings(subject, trusted) if isinstance(item, Check))


def accepted(subject: Subject) -> list[Check]:
    """Return the checks that found something.

    Raises:
        InputRejected: the first reason to reject the log.
    """
    checks = [check for check in check_log(subject) if check.level != "ok"]
    for check in checks:
        if check.level == "reject":
            raise check.as_error()
    return checks


def findings(subject: Subject, trusted: tuple[str, ...] = ()) -> tuple[Check | NotTested, ...]:
    """Return the checks of one log, and what could not be tested."""
    if subject.log.origin == "planned":
        return ()  # a plan has neither clock nor sensors
    if not subject.sampled:
        return tuple(length(subject))
    if not subject.good.time.advances:
        said = (item for check in ORDER_CHECKS for item in check(subject))
        return tuple(item for item in said if item.level != "ok")
    found = [item for check in CHECKS for item in check(subject) if item.code not in trusted]
    rejects = [item.code for item in found if item.level == "reject"]
    follows = {f"RRID-{code}" for reject in rejects for code in _CONSEQUENCES.get(reject, ())}
    return tuple(item for item in found if item.level == "ok" or item.code not in follows)


def columns_first(checks: Iterable[Check]) -> tuple[Check, ...]:
    """Return `checks` of one recorder, where mixed-up columns (S13) are put right before all else.

    A log that moves one joint alone then seems to have a wrong sign or scale (S14, S15).
    """
    every = list(checks)
    remedy = "nothing yet: the columns that are mixed up (RRID-S13) can explain it"
    if any(check.code == "RRID-S13" and check.gate for check in every):
        for k, check in enumerate(every):
            if check.code in ("RRID-S14", "RRID-S15") and check.level != "ok":
                every[k] = replace(check, remedy=f"{remedy}; put them right first")
    return tuple(every)


def check_together(opened: Sequence[Opened], subjects: Sequence[Subject]) -> tuple[Check, ...]:
    """D14, S21 and D10: what only several logs show, copies, names and one-way friction logs."""
    found = []
    for group in _groups(opened, lambda one: one.sha256):
        words = f"the same file {len(group)} times: {_listed(group)}"
        remedy = "keep one of them; a copy counts twice in a fit"
        found.append(Check.of("D14", "warn", words, where=group[0].path, remedy=remedy))
    sampled = [one for one in opened if one.log.origin != "planned" and one.log.n_samples > 1]
    for group in _groups(
        sampled, lambda one: sha256(one.log.q.tobytes() + one.log.tau.tobytes()).digest()
    ):
        roles = sorted({one.log.role for one in group})
        if len(roles) > 1:
            words = f"leak: {_listed(group)} hold the same samples with roles {' and '.join(roles)}"
            remedy, where = "judge on a recording that no model was fitted to", group[0].path
            found.append(Check.of("D14", "reject", words, where=where, gate=True, remedy=remedy))
    for group in _groups(opened, lambda one: (one.path.parent, one.log.name)):
        if len({one.sha256 for one in group}) > 1:
            words = f"{len(group)} logs are named '{group[0].log.name}': {_listed(group)}"
            remedy, where = "give each log of a folder a name of its own", group[0].path.parent
            found.append(Check.of("S21", "warn", words, where=where, remedy=remedy))
    return (*found, *_one_way_friction(subjects))


def _groups(opened: Iterable[Opened], key: Callable[[Opened], object]) -> list[list[Opened]]:
    """Return the groups of several logs with one `key`."""
    groups = defaultdict[object, list[Opened]](list)
    for one in opened:
        groups[key(one)].append(one)
    return [group for group in groups.values() if len(group) > 1]


def _listed(group: Iterable[Opened]) -> str:
    return ", ".join(one.path.name for one in group)


def _one_way_friction(subjects: Iterable[Subject]) -> list[Check]:
    """D10: all friction logs of a joint together move it both ways."""
    groups: dict[tuple[str, int], list[tuple[float, float, Subject]]] = defaultdict(list)
    for subject in subjects:
        if subject.log.experiment == "friction" and subject.sampled:
            for joint, (up, down) in both_ways(subject).items():
                groups[subject.log.robot_name, joint].append((up, down, subject))
    found, remedy = [], "record the joint in both directions"
    for (_, joint), members in groups.items():
        ups, downs, logs = zip(*members, strict=True)
        if min(max(ups), max(downs)) < CONFIG.one_way:
            words = f"the speed of joint {joint + 1} never changes sign in its friction logs: "
            words += f"Coulomb offset unidentifiable joint {joint + 1}"
            found.append(logs[0].say("D10", "warn", words, remedy, True, signal="q", joint=joint))
    return found
