"""Refuse logs of which a diagnosis makes no sense: columns, signs, scales or clocks mixed up.

said, boundary = examined(logs)     checks of each log, and what their torque is
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from pipelines.errors import Check
from pipelines.estimation.checks.boundary import (
    Boundary,
    boundary_findings,
    torque_boundary,
    without_followers,
)
from pipelines.estimation.checks.plausibility import mismatches
from pipelines.io.log import ExperimentLog, recording
from pipelines.quality.checks import Subject, check_log
from pipelines.simulation.commanded import against_command

__all__ = ["examined"]


def examined(
    logs: Iterable[ExperimentLog], skip_sanity_checks: bool = False, gates: bool = False
) -> tuple[tuple[Check, ...], Boundary | None]:
    """Return the checks of the logs that found something, and the torque boundary.

    Args:
        gates: whether a check that is allowed closes its gate all the same.

    Raises:
        InputRejected: the first reason to reject a log; S13, S23, S24, S25: the torque is not what
            the description says; S13, S14, S15, T06: torque and motion of a log do not belong
            together, with the repair, unless `skip_sanity_checks`.
    """
    every = list(logs)
    said = [_said(log, skip_sanity_checks=skip_sanity_checks) for log in every]
    closed = [told for told in said if isinstance(told, Check)]
    if reject := next((told for told in closed if told.level == "reject"), None):
        raise reject.as_error()
    boundary = torque_boundary(every)
    findings = boundary_findings(boundary, every[0].source or every[0].name if every else "")
    for told in (*(() if skip_sanity_checks else map(_with_way_out, findings)), *closed):
        raise told.as_error()
    checks = (check for told in said if not isinstance(told, Check) for check in told)
    found = (*findings, *without_followers(checks, findings))
    return tuple(check if gates else replace(check, gate=False) for check in found), boundary


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
    return (*checks, *against)
