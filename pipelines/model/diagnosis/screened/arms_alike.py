"""Arms that are nearly the same: what follows from them need not be laid again for each.

    arms = alike(data, own)            (joints + 1,) of arms that were asked for before, those that will do for what follows from
                                       the rigid body: at each joint, then at all
    arms = moving_alike(data, own)     (joints,) the same for what hangs on the friction and effects of that joint as well
    remember(data, arms)               columns have been laid for these

Which arms were asked for before is part of the answer, then: by a hundredth of a column, and by some more of one that is smooth
where much is left unexplained.

A link in its gap is followed sample by sample over all logs, for every gap at every joint: half of what a first screening takes.
An encoder that is not true changes the torque of the whole arm: half of any other. A cause that was found moves the base
parameters of the joints beside it by some parts in ten thousand, and what it adds is torque of its own joint.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from pipelines.log.experiment import Array
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import rigid_rows
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.rows.kept import Kept

__all__ = ["Asked", "alike", "moving_alike", "remember"]

Mask = npt.NDArray[np.bool_]

# Of a joint's torque: what arms differ by at most. Gains of gaps then are the same to 3e-5 of the squared residual, a
# hundredth of what any cause is looked at for; at thirty times as much they are off by up to a half. Columns of a tilt, a link and
# a delay are the same to 0.6 % then, those of an elastic joint to 0.8 %.
_ALIKE = 1e-3
# The same of columns that are smooth, a tilt's say and no gap's, where much is left of the joint: to a fiftieth of that no arm is
# known while a great cause is yet to be found, or is looked for once more because something that stands was taken out; of the
# joint's torque at most. Such columns are off by 6 % then, and gain less by the square of that.
_OF_LEFT, _FARTHEST = 0.02, 1e-2
_MOST = 16  # arms that are remembered


@dataclass(frozen=True, eq=False)
class Asked:
    """An arm for which columns are laid. Arrays (rows,) [N m], where nothing else is said."""

    arm: Arm
    rigid: Array  # torque of its rigid body
    torque: Array  # all of it
    left: Array  # (joints,) [N m] rms of what it leaves

    @classmethod
    def of(cls, data: Data, model: Exact, torque: Array) -> Asked:
        """`torque`: that of the model."""
        rigid = np.asarray(model.beta[:len(model.columns.kept)] @ rigid_rows(data, model.columns))
        return cls(model.arm, rigid, torque, data.rms(data.y - torque))


_Places = tuple[int, ...]  # of the logs among those that are kept together
_KNOWN: WeakKeyDictionary[Kept, list[tuple[_Places, Asked]]] = WeakKeyDictionary()  # by where their columns are kept


def alike(data: Data, own: Asked) -> tuple[Asked, ...]:
    """The first arm that has nearly the rigid torque of this one at a joint, and at all; else this one, and so where something
    changes how every torque is recorded."""
    able = _able(data, own)
    near = [(one, _near(data, one.rigid, own.rigid)) for one in able]
    alone = (next((one for one, same in near if same[joint]), own) for joint in range(data.n_joints))
    return (*alone, next((one for one in able if _near(data, one.rigid, own.rigid, own.left).all()), own))


def moving_alike(data: Data, own: Asked) -> tuple[Asked, ...]:
    """The first that has nearly its rigid torque at all joints and nearly all of its torque at this one; at all of them, and the
    same effects, where some do more than to add a torque of their own joint."""
    several = _several(own.arm)
    near = [(one, _near(data, one.torque, own.torque, own.left)) for one in _able(data, own)
            if _several(one.arm) == several and _near(data, one.rigid, own.rigid, own.left).all()]
    near = [(one, same) for one, same in near if not several or same.all()]
    return tuple(next((one for one, same in near if same[joint]), own) for joint in range(data.n_joints))


def remember(data: Data, arms: Iterable[Asked]) -> None:
    """They are alike for others after them; none whose effects change how torque is recorded."""
    kept = _KNOWN.setdefault(data.logs[0].kept, [])
    for one in arms:
        if not any(one.arm is other.arm for other in _known(data)) and not _late(one.arm):
            kept.append((_places(data), one))
    del kept[:-_MOST]


def _near(data: Data, torque: Array, own: Array, left: Array | float = 0.0) -> Mask:
    """(joints,) at which they differ by next to nothing, or by little of what is `left` (joints,) [N m]."""
    size = data.rms(own)
    return np.asarray(data.rms(torque - own) <= np.maximum(_ALIKE * size, np.minimum(_OF_LEFT * left, _FARTHEST * size)))


def _able(data: Data, own: Asked) -> list[Asked]:
    return [] if _late(own.arm) else _known(data)


def _late(arm: Arm) -> bool:
    """Return whether something changes how every torque is recorded."""
    return any(acting.effect.last for acting in arm.effects)


def _several(arm: Arm) -> set[str]:
    """Places of what changes the torque of others, or may: all but what adds, by the motion, to its own joint."""
    return {acting.place for acting in arm.effects if not (acting.effect.from_motion and acting.effect.adds)}


def _known(data: Data) -> list[Asked]:
    """Those of the very logs, the oldest first."""
    return [one for places, one in _KNOWN.get(data.logs[0].kept, []) if places == _places(data)]


def _places(data: Data) -> _Places:
    return tuple(log.place for log in data.logs)
