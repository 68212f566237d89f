"""Let the doctor see a new log before it is written, so that `inspect` passes on every log that `import` makes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.errors import Check, clean
from pipelines.log.doctor.checks import check_log
from pipelines.log.doctor.checks_motion import degrees_or_motor
from pipelines.log.doctor.checks_unit import TRUSTED, torque_in_recipe
from pipelines.log.experiment import ExperimentLog

__all__ = ["examine"]

# A glitch was recorded as it stands there: what to make of it is for whoever uses the log to decide.
_KEPT = "RRID-D06"
_TIME = (
    "RRID-S08"  # what a recipe declares of time can be wrong by a thousand, and contradict nothing
)

# What to do about it stands in the recipe, and not in a file that is not written yet.
_IN_RECIPE = {
    "RRID-S05": torque_in_recipe(),
    "RRID-S07": degrees_or_motor(np.inf, (-np.inf, np.inf)),
}


def examine(log: ExperimentLog, recording: str, trust_units: bool) -> tuple[Check, ...]:
    """What the doctor finds in `log` that the import has not said already: glitches, which stay, and time in another unit.

    Raises:
        InputRejected: what the doctor would reject, or would have to mend before use: the import should have.
    """
    found = []
    for check in check_log(replace(log, source=recording), TRUSTED if trust_units else ()):
        if check.level == "reject" or (check.level == "repair" and check.code != _KEPT):
            raise replace(check, remedy=_IN_RECIPE.get(check.code, check.remedy)).as_error()
        if check.code == _TIME and check.level == "warn":
            found.append(check)
        if check.code == _KEPT and check.level == "repair":
            words = check.message.removesuffix("; left out") + "; kept in the log, left out of fits"
            found.append(replace(check, level="warn", message=clean(words)))
    return tuple(found)
