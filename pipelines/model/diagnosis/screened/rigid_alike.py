"""Arms whose rigid bodies are nearly the same: what follows from the rigid body alone need not be laid again for each of them.

    arms = alike(data, model)      (joints + 1,) of arms that were asked for before, where one will do: for each joint, then for all
    remember(data, arms)           columns have been laid for these

Which arms were asked for before is part of the answer, then, in its last digits.

A link in its gap is followed sample by sample over all logs, for every gap at every joint: half of what a screening takes. A cause
that was found moves the base parameters of the joints beside it by some parts in ten thousand.
"""

from __future__ import annotations

from collections.abc import Iterable
from weakref import WeakKeyDictionary

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import rigid_rows
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.rows.kept import Kept

__all__ = ["RigidArm", "alike", "remember"]

# Of a joint's rigid torque: what arms differ by at most. Gains of gaps then are the same to 3e-5 of the squared residual, a
# hundredth of what any cause is looked at for; at thirty times as much they are off by up to a half.
_ALIKE = 1e-3
_MOST = 8  # arms that are remembered

RigidArm = tuple[Arm, Array]  # and its rigid torque (rows,) [N m]
_Places = tuple[int, ...]  # of the logs among those that are kept together
_KNOWN: WeakKeyDictionary[Kept, list[tuple[_Places, RigidArm]]] = WeakKeyDictionary()  # by where their columns are kept


def alike(data: Data, model: Exact) -> tuple[RigidArm, ...]:
    """The first arm that has nearly the rigid torque of `model`'s at a joint, and at all; else the model's own, and so where
    something changes how every torque is recorded."""
    own = model.arm, np.asarray(model.beta[:len(model.columns.kept)] @ rigid_rows(data, model.columns))
    known = () if any(one.effect.last for one in model.effects) else _known(data)
    allowed, every = _ALIKE * data.rms(own[1]), range(data.n_joints)
    near = [(one, data.rms(one[1] - own[1]) <= allowed) for one in known]
    return tuple(next((one for one, same in near if same[joints].all()), own) for joints in (*every, list(every)))


def remember(data: Data, arms: Iterable[RigidArm]) -> None:
    """They are alike for others after them; none whose effects change how torque is recorded."""
    kept = _KNOWN.setdefault(data.logs[0].kept, [])
    for one in arms:
        if not any(one[0] is other for other, _ in _known(data)) and not any(acting.effect.last for acting in one[0].effects):
            kept.append((_places(data), one))
    del kept[:-_MOST]


def _known(data: Data) -> list[RigidArm]:
    """Those of the very logs, the oldest first."""
    return [one for places, one in _KNOWN.get(data.logs[0].kept, []) if places == _places(data)]


def _places(data: Data) -> _Places:
    return tuple(log.place for log in data.logs)
