"""What gives way, named by frequency responses: the residual of motion alone does not tell a base from a joint, or from a gap.

    told = compliance(logs.frf, arm)
    told.findings          causes that the responses name
    told.rigid             whether they show a rigid arm: what gives way then does so at reversals only, and is a gap
    untold(told)           causes that they leave open, with the reason
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.errors import InputRejected
from pipelines.log.experiment import ExperimentLog
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.result import Finding, Gain, NotTestable, TorqueGain, Value
from pipelines.model.effects import all_effects, find_effect
from pipelines.model.frf import findings as frf

__all__ = ["Compliance", "compliance", "untold"]

_POSTURES = 2  # that it takes


@dataclass(frozen=True)
class Compliance:
    """What the responses say."""

    findings: tuple[Finding, ...]
    rigid: bool
    open: str  # what they leave open, in words; empty where they do not


def compliance(logs: Sequence[ExperimentLog], arm: Arm, without: Sequence[str] = ()) -> Compliance | None:
    """None without frequency-response logs; causes in `without` are not named."""
    if not logs:
        return None
    try:
        found = frf.frf_findings(logs, arm)
    except InputRejected as refused:
        return Compliance((), False, f"the frequency responses are of no use: {refused.message}")
    giving = [one for one in found.classification
              if one.cause is not None and find_effect(one.cause).evidence == "frequency responses"]
    named = tuple(_finding(one, arm) for one in giving if one.cause not in without)
    left = "; ".join(one.evidence for one in found.undecided)
    return Compliance(named, not giving and not found.undecided, left)


def untold(told: Compliance | None, without: Sequence[str] = ()) -> tuple[NotTestable, ...]:
    """Causes that only frequency responses tell, where there are none, or where they leave it open."""
    reason = "only frequency responses tell it, and there is no frf log" if told is None else told.open
    named = () if told is None else tuple(one.cause for one in told.findings)
    return tuple(NotTestable(kind.name, None, reason, kind.experiment) for kind in all_effects()
                 if reason and kind.evidence == "frequency responses" and kind.name not in (*named, *without))


def _finding(one: frf.Finding, arm: Arm) -> Finding:
    effect = find_effect(one.cause or "")
    joint = one.joint if effect.scope == "joint" else None
    turning = joint is None or arm.robot.revolute[joint - 1]
    units = {q.name: q.unit_at(turning) for q in effect.parameters}
    numbers = {name: Value(known.value, known.std, units.get(name, "1")) for name, known in one.parameters.items()}
    nothing = np.full(arm.n_joints, np.nan)
    gain = Gain(TorqueGain(nothing, nothing, np.full((arm.n_joints, 2), np.nan)), None, "none", None)
    return Finding(effect.name, joint, effect.title, numbers, np.nan, np.nan, (), None, gain, "frequency responses", np.nan, np.nan,
                   None)
