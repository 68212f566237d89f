"""Where the locked joints stood: inertia and gravity of the driven one belong to that posture, friction does not.

Logs whose locked joints stand apart by less than encoders and controllers make of one posture are taken together.
"""

from __future__ import annotations

from collections.abc import Sequence

from pipelines.model.friction.weak_form import Stretch

__all__ = ["alike", "nearest", "posture_groups"]

_ALIKE = 0.02  # [rad] by which locked joints may stand apart and the inertia still be the same


def posture_groups(stretches: Sequence[Stretch]) -> tuple[tuple[float, ...], ...]:
    """Postures of the locked joints that are apart."""
    found: list[tuple[float, ...]] = []
    for stretch in stretches:
        if not any(alike(stretch.posture, posture) for posture in found):
            found.append(stretch.posture)
    return tuple(found)


def nearest(posture: tuple[float, ...], known: Sequence[tuple[float, ...]]) -> int:
    return min(range(len(known)), key=lambda k: _apart(posture, known[k]))


def alike(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    """Return whether inertia and gravity may be taken as the same."""
    return _apart(a, b) < _ALIKE


def _apart(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    return max((abs(x - y) for x, y in zip(a, b, strict=True)), default=0.0)
