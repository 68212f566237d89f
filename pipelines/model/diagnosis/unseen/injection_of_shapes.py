"""The weakest of a cause whose torque physics gives: of a clipped drive or a gap nothing but a non-linear number says how much.

    hidden = weakest(family, bound, probe)          the shape; None where no shape of it could be

Each shape of the family is put into what the final model leaves, once and as it is, and the model is fitted anew. It is found where
the best shape, which need not be the hidden one, takes more off the squared residual than the threshold, and what is held out
becomes smaller by more than chance does: the same that `injection` asks for, with nothing to scale. The weakest is the one that is
seen held out too, and from which on every stronger one that is tried is found as well: weaker ones than are tried may be found too.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import takewhile
from typing import TypeVar

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.screened.candidates import Family, Laid, lay_family
from pipelines.model.diagnosis.unseen.injection import Draw, Hidden, Probe, held_out, quadratics
from pipelines.model.effects.base import Effect

__all__ = ["weakest"]

T = TypeVar("T")

_STRENGTHS, _ALIKE = 8, 3  # of a family that are hidden, and looked for; shapes of one strength: lubricants of a gap
_SHAPES = 12  # at most
_RANK = 0.75  # of the shapes of one strength, which differ in a lubricant say, so many have to be found


def weakest(family: Family, bound: float, probe: Probe) -> Hidden | None:
    """The shape from which on all stronger ones are found.

    Args:
        bound: the gain that the cause has to exceed.
    """
    given = family.shapes[0].fixed_amplitudes
    if family.event or given is None or not np.isfinite(bound):
        return None
    amplitudes = np.array(given)
    family = replace(family, shapes=tuple(_some(family.shapes)))
    laid = tuple(lay_family(probe.data, family, probe.arms.of(family)))
    hidden = list(_hidden(family, laid, amplitudes, probe))
    if not hidden:
        return None
    gains = np.full(len(hidden), -np.inf)
    for alone, both, nothing in quadratics(laid, probe, np.array([left for _, _, left in hidden])):
        gains = np.maximum(gains, (alone + 2.0 * both + nothing).max(axis=0))
    shown: dict[float, list[tuple[Effect, Array, bool]]] = {}
    for (effect, columns, _), gain in zip(hidden, gains.tolist(), strict=True):
        shown.setdefault(effect.strength, []).append((effect, columns, gain > bound))
    strongest = (shown[strength] for strength in sorted(shown, reverse=True))
    passing = list(takewhile(lambda some: np.mean([found for *_, found in some]) >= _RANK, strongest))
    last = next((some[0][0] for some in reversed(passing) if _seen_held_out(some, amplitudes, probe)), None)
    return Hidden(last or hidden[0][0], amplitudes, last is not None)


def _some(shapes: Sequence[Effect]) -> Iterator[Effect]:
    """A few strengths from the whole range, each by a few of the shapes that have it."""
    alike: dict[float, list[Effect]] = {}
    for one in shapes:
        alike.setdefault(one.strength, []).append(one)
    each = min(max(map(len, alike.values())), _ALIKE)
    for strength in _spread(sorted(alike), min(_STRENGTHS, _SHAPES // each)):
        yield from _spread(alike[strength], each)


def _spread(some: Sequence[T], most: int) -> list[T]:
    """`most` of them, the first and the last among them."""
    return [some[k] for k in np.unique(np.linspace(0, len(some) - 1, min(len(some), most)).round().astype(int)).tolist()]


def _hidden(family: Family, every: Iterable[Laid], amplitudes: Array, probe: Probe) -> Iterator[tuple[Effect, Array, Array]]:
    """Each shape that such an arm could have, its columns (k, rows of the final model), and what the fit leaves of it, weighted."""
    motions = [log.motion for log in probe.final.data.logs]
    for laid in every:
        for place, table in enumerate(laid.table, laid.first):
            effect = family.shapes[place]
            if effect.possible(effect.values(amplitudes)) and effect.believable(motions, probe.arms.now):
                columns = probe.own(laid.rows, table)
                yield effect, columns, probe.left_of(amplitudes @ columns)


def _seen_held_out(some: list[tuple[Effect, Array, bool]], amplitudes: Array, probe: Probe) -> bool:
    """Whether the first of them that is found makes what is held out smaller, when it is fitted."""
    effect, columns, _ = next(one for one in some if one[2])
    (factor,) = held_out(Draw(effect, columns, amplitudes, 1.0), [amplitudes], probe)
    return factor(1.0) == 1.0
