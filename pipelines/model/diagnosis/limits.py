"""What these logs can and cannot tell: the smallest cause that would have been found, and what the model absorbs.

    detectable(step, fit)           the amplitude that exceeds its threshold with 95 %
    not_testable(...)               causes of which nothing shows, with the parameters that hide them

A cause of amplitude A adds A²‖c⊥‖² to what it gains, give or take what chance gives it on the twin. It is found with 95 % where
A ‖c⊥‖ exceeds the root of the threshold by 1.65 of that. c⊥ is that of a shape that reaches less than three quarters of them do.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.data import Data
from pipelines.model.diagnosis.nominal import Fit
from pipelines.model.diagnosis.result import Detectable, NotTestable, Value
from pipelines.model.diagnosis.screen import Screened
from pipelines.model.diagnosis.thresholds import Thresholds
from pipelines.model.effects import all_effects
from pipelines.model.effects.base import Effect
from pipelines.model.estimation.regression import Columns
from pipelines.model.rigid.body import Motion

__all__ = ["detectable", "not_testable"]

_SIDE = 1.65  # normal deviate of 95 %, one-sided
_VISIBLE = 0.02  # η below which a cause cannot be told from the model
_MAIN = 0.1  # of a column: a parameter that makes up less of it does not hide it


def detectable(screened: Sequence[Screened], thresholds: Thresholds, revolute: tuple[bool, ...]) -> tuple[Detectable, ...]:
    """Every cause that shows, with the smallest amplitude that would have been found."""
    found = []
    for one, bound, chance in zip(screened, thresholds.gain, thresholds.own, strict=True):
        effect = one.family.shapes[0]
        if one.best_visibility < _VISIBLE or one.reach <= 0.0 or effect.evidence != "residual":
            continue
        size = (np.sqrt(bound) + _SIDE * np.sqrt(chance)) / one.reach
        found.append(_limit(effect, one.width, float(size), revolute))
    return tuple(one for one in found if one is not None)


def _limit(effect: Effect, width: int, size: float, revolute: tuple[bool, ...]) -> Detectable | None:
    """The reported parameter that goes with the first amplitude."""
    names = [q for q in effect.parameters if not q.shape and not q.derived]
    amplitudes = np.zeros(width)
    amplitudes[0] = size
    if effect.fixed_amplitudes is not None:
        return None
    values = effect.values(amplitudes)
    main = next((q for q in names if values.get(q.name) and np.isfinite(values[q.name])), None)
    if main is None:
        return None
    turning = effect.joint is None or revolute[effect.joint - 1]
    return Detectable(effect.name, effect.joint, main.name, Value(abs(values[main.name]), None, main.unit_at(turning)))


def not_testable(data: Data, fit: Fit, columns: Columns, screened: Sequence[Screened], arm: Arm,
                 reference: bool, without: Sequence[str]) -> tuple[NotTestable, ...]:
    """Causes that the nominal model takes in, in these logs.

    Args:
        reference: whether there are reference logs, which tell what is absorbed within one session.
    """
    found = []
    for one in screened:
        if one.best_visibility < _VISIBLE:
            found.append(_absorbed(one.family.shapes[0], data, fit, columns, arm, "needs other motion"))
    for kind in all_effects():
        if kind.name in without:
            continue
        if kind.evidence == "base parameters" and not reference:
            found += [_absorbed(effect, data, fit, columns, arm, "") for effect in kind.everywhere(arm.n_joints)]
        elif kind.evidence == "residual" and kind.needs and kind.scope == "joint":
            found += _common(kind, data, fit, columns, arm)
    return tuple(found)


def _absorbed(effect: Effect, data: Data, fit: Fit, columns: Columns, arm: Arm, wanted: str) -> NotTestable:
    shape = next(iter(effect.shapes(data.logs[0].motion, arm)), effect)
    table = data.lay(lambda motion: shape.columns(motion, arm))
    need = f"needs {' and '.join(effect.needs)}" if effect.needs else wanted
    hiding = ", ".join(_hiding(table, fit, columns))
    return NotTestable(effect.name, effect.joint, f"absorbed by {hiding}{'; ' if need else ''}{need}", effect.experiment)


def _common(kind: type[Effect], data: Data, fit: Fit, columns: Columns, arm: Arm) -> list[NotTestable]:
    """A cause at all joints alike, where the model hides it though it shows at one joint."""
    def together(motion: Motion) -> Array:
        return np.asarray(sum(effect.columns(motion, arm) for effect in kind.everywhere(arm.n_joints)))

    table = data.lay(together)
    left = np.linalg.norm(fit.project(table)) / max(float(np.linalg.norm(table * fit.weights)), 1e-300)
    if left >= _VISIBLE:
        return []
    one = kind.everywhere(arm.n_joints)[0]
    return [NotTestable(kind.name, None, f"the same at all joints it is absorbed by {', '.join(_hiding(table, fit, columns))}; "
                        f"needs {' and '.join(kind.needs)}", one.experiment)]


def _hiding(table: Array, fit: Fit, columns: Columns) -> list[str]:
    """Names of the parameters that make up a column of `table` (k, rows) that the fit imitates."""
    weighted = fit.table * fit.weights
    size = np.linalg.norm(weighted, axis=1)
    size = np.where(size > 0.0, size, 1.0)
    unit = weighted / size[:, None]
    values, vectors = np.linalg.eigh(unit @ unit.T)
    keep = values > 1e-10 * values[-1]
    inverse = (vectors[:, keep] / values[keep]) @ vectors[:, keep].T
    main: dict[int, float] = {}
    for column in table * fit.weights:
        own = float(np.linalg.norm(column))
        for k, share in enumerate(np.abs(inverse @ (unit @ column)) / max(own, 1e-300)):
            main[k] = max(main.get(k, 0.0), float(share))
    names = [column.name for column in columns.names]
    chosen = [k for k, share in main.items() if share > _MAIN and k < len(names)]
    return [names[k] for k in sorted(chosen)] or ["all base parameters together"]
