"""Refuse logs of which a diagnosis makes no sense: columns, signs, scales or clocks mixed up.

said, boundary = examined(logs)     checks of each log, and what their torque is
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from pipelines.errors import Check, InputRejected, NothingMatched
from pipelines.estimation.checks.boundary import (
    Boundary,
    boundary_findings,
    torque_boundary,
    without_followers,
)
from pipelines.estimation.checks.plausibility import mismatches
from pipelines.estimation.preparation import Logs
from pipelines.io.log import ExperimentLog, recording
from pipelines.quality.checks import Subject, check_log
from pipelines.simulation.commanded import against_command

__all__ = ["examined", "logs_of_roles"]


def examined(
    logs: Iterable[ExperimentLog], skip_sanity_checks: bool = False
) -> tuple[tuple[Check, ...], Boundary | None]:
    """Return the checks of the logs that found something, and the torque boundary.

    Raises:
        InputRejected: the first reason to reject a log; S13, S23, S24, S25: the torque is not what
            the description says; S13, S14, S15, T06: torque and motion of a log do not belong
            together, with the repair, unless `skip_sanity_checks`.
    """
    every = list(logs)
    said = [_said(log, skip_sanity_checks=skip_sanity_checks) for log in every]
    gates = [told for told in said if isinstance(told, Check)]
    if reject := next((told for told in gates if told.level == "reject"), None):
        raise reject.as_error()
    boundary = torque_boundary(every)
    findings = boundary_findings(boundary, every[0].source or every[0].name if every else "")
    for told in (*(() if skip_sanity_checks else map(_with_way_out, findings)), *gates):
        raise told.as_error()
    checks = tuple(check for told in said if not isinstance(told, Check) for check in told)
    found = (replace(check, gate=False) for check in findings)
    return (*found, *without_followers(checks, findings)), boundary


def _with_way_out(check: Check) -> Check:
    way_out = "if it is right as it is, say --skip-sanity-checks"
    return replace(check, remedy=f"{check.remedy}; {way_out}")


def _said(log: ExperimentLog, skip_sanity_checks: bool) -> tuple[Check, ...] | Check:
    """Return the checks of one log, or the one that rejects it."""
    subject = Subject(recording(log))
    checks = [check for check in check_log(subject) if check.level != "ok"]
    if reject := next((check for check in checks if check.level == "reject"), None):
        # A controller says by how much a torque is too large, its limits only that it is.
        exact = against_command(subject) if reject.code == "RRID-S05" else ()
        return next((check for check in exact if check.code == "RRID-S10"), reject)
    against = mismatches(subject)
    if not skip_sanity_checks and (gate := next((check for check in against if check.gate), None)):
        return _with_way_out(gate)
    return tuple(replace(check, gate=False) for check in (*checks, *against))


def logs_of_roles(logs: Sequence[ExperimentLog], label: str) -> Logs:
    """Return the logs by what they are for, without plans.

    Raises:
        NothingMatched: C06, no log to fit.
        InputRejected: D14, one recording in two roles.
    """
    known = [log for log in logs if log.origin != "planned"]
    chosen = Logs.by_role(known)
    if not chosen.identify:
        kinds = ", ".join(sorted({f"{log.experiment} ({log.role})" for log in known})) or "none"
        raise NothingMatched(
            "C06",
            f"no excitation, free or writing log of role identify; there are: {kinds}",
            where=label,
            remedy="record an excitation, or name the logs to fit: --identify PATH",
        )
    _refuse_leak(chosen.identify, chosen.validate)
    _refuse_leak(chosen.reference, (*chosen.identify, *chosen.validate))
    return chosen


def _refuse_leak(fitted: Sequence[ExperimentLog], judging: Sequence[ExperimentLog]) -> None:
    """D14: what a model was fitted to must not judge it."""
    seen = {log.q.tobytes() + log.tau.tobytes(): log for log in fitted}
    for log in judging:
        if (same := seen.get(log.q.tobytes() + log.tau.tobytes())) is not None:
            roles = f"{same.role} and {log.role}"
            raise InputRejected(
                "D14",
                f"leak: {same.name} and {log.name} hold the same samples with roles {roles}",
                where=log.source or log.name,
                remedy="judge on another recording",
            )
