"""What a report says where base parameters took a finding in, a load say: what its figures are counted from."""

from __future__ import annotations

from collections.abc import Sequence

from pipelines.model.diagnosis.result import Diagnosis, Trial
from pipelines.report.diagnosis_words import named, per_joint
from pipelines.report.joint_units import Units

__all__ = ["of_moved", "unmoved_words"]

_OF_MOVED = (" The gain of what base parameters show is counted from one set of them for before and after; "
             "\"fitted exactly\" it is that on held-out time, over the base parameters of before.")


def unmoved_words(found: Diagnosis, units: Units) -> str:
    """Whose error "now" is: that of the base parameters of before, for those fitted to these logs took the finding in."""
    taken = [named(one.cause, one.joint) for one in found.findings if one.origin == "base parameters"]
    if found.unmoved_rms is None or not taken:
        return ""
    return (f"Now: by the base parameters of before, without {taken[0]}. Fitted to these logs they take it in, and the "
            f"nominal model leaves {per_joint(found.residual_rms.validate)} {units.torque}. ")


def of_moved(trials: Sequence[Trial]) -> str:
    """What the gain of a cause that base parameters show is a share of; empty where no trial is of one."""
    return _OF_MOVED if any(one.of == "base parameters" for one in trials) else ""
