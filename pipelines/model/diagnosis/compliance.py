"""What gives way, named by frequency responses: the residual of motion alone does not tell a base from a joint, or from a gap.

    told = compliance(logs.frf, arm)
    told.findings          causes that the responses name
    told.rigid             whether they show a rigid arm: what gives way then does so at reversals only, and is a gap
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.errors import InputRejected
from pipelines.log.experiment import ExperimentLog
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.result import Finding, Gain, TorqueGain, Value
from pipelines.model.effects import find_effect
from pipelines.model.frf import findings as frf

__all__ = ["Compliance", "compliance"]

_POSTURES = 2  # that it takes


@dataclass(frozen=True)
class Compliance:
    """What the responses say."""

    findings: tuple[Finding, ...]
    rigid: bool
    open: str  # what they leave open, in words; empty where they do not


def compliance(logs: Sequence[ExperimentLog], arm: Arm) -> Compliance | None:
    """None without responses of every joint in question, or where no response can be taken."""
    if not logs:
        return None
    try:
        found = frf.frf_findings(logs, arm)
    except InputRejected:
        return None
    named = tuple(_finding(one, arm) for one in found.classification
                  if one.cause is not None and find_effect(one.cause).evidence == "frequency responses")
    left = "; ".join(one.evidence for one in found.undecided)
    return Compliance(named, not named and not found.undecided, left)


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
