"""What these logs can and cannot tell: the smallest cause that would have been found, and what the model absorbs.

    detectable(screened, thresholds, revolute, probe)       the amplitude that is found with 95 %
    not_testable(...)                                       causes of which nothing shows, with the parameters that hide them

The amplitude is found by hiding the cause in the logs (`injection`). Of what is not hidden, events, a formula tells it: a cause of
amplitude A adds A²‖c⊥‖² to what it gains, give or take what chance gives it on the twin. It is found with 95 % where
A ‖c⊥‖ exceeds the root of the threshold by 1.65 of that. c⊥ is that of a shape that reaches less than three quarters of them do.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Literal

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.fitted.nominal import Fit
from pipelines.model.diagnosis.floor.thresholds import Thresholds
from pipelines.model.diagnosis.result import Detectable, NotTestable, Value
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.screened.candidates import Family, runs_away
from pipelines.model.diagnosis.screened.screen import Screened, for_each
from pipelines.model.diagnosis.unseen.injection import Hidden, Probe
from pipelines.model.diagnosis.unseen.injection import smallest as smallest_hidden
from pipelines.model.diagnosis.unseen.injection_of_shapes import weakest
from pipelines.model.effects import all_effects
from pipelines.model.effects.base import Effect
from pipelines.model.estimation.regression import Columns
from pipelines.model.rigid.body import Motion

__all__ = ["detectable", "not_testable"]

_SIDE = 1.65  # normal deviate of 95 %, one-sided
_TOO_MUCH = "these logs cannot show it: no arm has so much of it that they would"
_AT_NONE = "hidden in these logs it was found at no strength"
_VISIBLE = 0.02  # η below which a cause cannot be told from the model
_MAIN = 0.1  # of a column: a parameter that makes up less of it does not hide it


def detectable(screened: Sequence[Screened], thresholds: Thresholds, revolute: tuple[bool, ...],
               probe: Probe | None = None, nameable: Collection[str] = ("residual",), slight: bool = False,
               ) -> tuple[tuple[Detectable, ...], tuple[NotTestable, ...]]:
    """Every cause that shows, with the smallest amplitude that would have been found; and those for which it is beyond its range.

    Args:
        screened, thresholds: of the last step, in the order of the families.
        probe: the final model, into whose logs causes are put; None: by the formula above.
        nameable: kinds of evidence there are.
        slight: what arms in order have as much of has no name, however sure it is.
    """
    found, beyond = [], []
    named = {(e.effect.name, e.effect.joint) for e in probe.final.model.effects} if probe is not None else set()
    asked = [(one, float(bound), chance) for one, bound, chance in zip(screened, thresholds.gain, thresholds.own, strict=True)
             if not (one.best_visibility < _VISIBLE or one.family.shapes[0].evidence not in nameable
                     or (one.cause, one.joint) in named)]
    smallest = {} if probe is None else _smallest({one.family: bound for one, bound, _ in asked}, probe)
    for one, bound, chance in asked:
        effect, hidden = one.family.shapes[0], smallest.get(one.family)
        limit = None
        if hidden is not None:
            limit = _limit(hidden.effect, hidden.amplitudes, revolute, one.best_visibility, "injected", slight)
        elif effect.fixed_amplitudes is None and one.reach > 0.0 and np.isfinite(bound):
            amplitudes = (np.sqrt(bound) + _SIDE * np.sqrt(chance)) / one.reach * np.eye(one.width)[0]
            limit = _limit(effect, amplitudes, revolute, one.best_visibility, "analytic", slight)
        told, possible = limit or (None, False)
        if told is not None and possible and (hidden is None or hidden.found) and (probe is None or _of_size(told, effect, probe)):
            found.append(told)
            continue
        if told is None and (one.family.event or effect.fixed_amplitudes is not None or not np.isfinite(bound)):
            continue
        why = _AT_NONE if hidden is not None and not hidden.found else _TOO_MUCH
        beyond.append(NotTestable(effect.name, effect.joint, why, effect.experiment))
    return tuple(found), tuple(beyond)


def _of_size(told: Detectable, effect: Effect, probe: Probe) -> bool:
    """Whether a torque that is found is none beyond the largest that the machine has given."""
    unit = next(q.unit for q in effect.parameters if q.name == told.parameter)
    size = told.smallest.value
    return unit != "N m" or not isinstance(size, float) or size <= probe.data.largest_torque(effect.joint)


def _smallest(bounds: Mapping[Family, float], probe: Probe) -> dict[Family, Hidden | None]:
    """Of each family, by two processes."""
    _ = probe.draws, probe.absorbing  # once, before there are two

    def hidden(family: Family) -> Hidden | None:
        return (smallest_hidden if family.shapes[0].fixed_amplitudes is None else weakest)(family, bounds[family], probe)

    found = for_each(probe.data, hidden, tuple(bounds), (probe.fit, probe.final.fit), *probe.arms.every)
    return dict(zip(bounds, found, strict=True))


def _limit(effect: Effect, amplitudes: Array, revolute: tuple[bool, ...], visibility: float,
           way: Literal["injected", "analytic"], slight: bool = False) -> tuple[Detectable, bool] | None:
    """The reported parameter that goes with the amplitudes, and whether its range holds it."""
    if slight and len(amplitudes) == 1 and 0.0 < abs(amplitudes[0]) < effect.slight:
        amplitudes = np.sign(amplitudes) * effect.slight
    values = effect.values(amplitudes)
    if effect.fixed_amplitudes is not None:
        q = next(q for q in effect.parameters if q.name == effect.grows_with)
        unit = q.unit_at(effect.joint is None or revolute[effect.joint - 1])
        return Detectable(effect.name, effect.joint, q.name, Value(values[q.name], None, unit), {}, way, visibility,
                          effect.strength < 0.0), True
    main = next((q for q in effect.parameters if not q.shape and not q.derived and values.get(q.name)
                 and np.isfinite(values[q.name])), None)
    if main is None:
        return None
    turning = effect.joint is None or revolute[effect.joint - 1]
    shown = effect.reported(values)
    at = {q.name: Value(values[q.name], None, q.unit_at(turning)) for q in effect.parameters
          if q.shape and q.name in shown and np.isfinite(values.get(q.name, np.nan))}
    size = abs(values[main.name])
    smallest = Value(size, None, main.unit_at(turning))
    return Detectable(effect.name, effect.joint, main.name, smallest, at, way, visibility), size <= max(abs(main.low), main.high)


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
            found += [_absorbed(effect, data, fit, columns, arm, "") for effect in kind.everywhere(arm.robot.revolute)]
        elif kind.evidence == "residual" and kind.needs and kind.scope == "joint":
            found += _common(kind, data, fit, columns, arm)
    return tuple(found)


def _absorbed(effect: Effect, data: Data, fit: Fit, columns: Columns, arm: Arm, wanted: str) -> NotTestable:
    shape = next(iter(effect.shapes(data.logs[0].motion, arm)), effect)
    with np.errstate(all="ignore"):
        table = data.lay(lambda motion: shape.columns(motion, arm))
    if runs_away(table):
        why = "the fitted arm is known too badly for its torque to be worked out; needs other motion"
        return NotTestable(effect.name, effect.joint, why, effect.experiment)
    need = f"needs {' and '.join(effect.needs)}" if effect.needs else wanted
    hiding = ", ".join(_hiding(table, fit, columns))
    return NotTestable(effect.name, effect.joint, f"absorbed by {hiding}{'; ' if need else ''}{need}", effect.experiment)


def _common(kind: type[Effect], data: Data, fit: Fit, columns: Columns, arm: Arm) -> list[NotTestable]:
    """A cause at all joints alike, where the model hides it though it shows at one joint."""
    def together(motion: Motion) -> Array:
        return np.asarray(sum(effect.columns(motion, arm) for effect in kind.everywhere(arm.robot.revolute)))

    table = data.lay(together)
    left = np.linalg.norm(fit.project(table)) / max(float(np.linalg.norm(table * fit.weights)), 1e-300)
    if left >= _VISIBLE:
        return []
    one = kind.everywhere(arm.robot.revolute)[0]
    return [NotTestable(kind.name, None, f"where it is the same at all joints, absorbed by "
                        f"{', '.join(_hiding(table, fit, columns))}; needs {' and '.join(kind.needs)}", one.experiment)]


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
