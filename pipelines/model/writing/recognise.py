"""Read a writing task back from the path of its tip: which letter was written when.

    letters = read_letters(tip)          letters[2].character, .first, .last; none where it is no text of our letters
    down = pen_down(tip)                 (samples,) where it writes, not on its way between strokes; None where it is no text

A log of a writing experiment holds joint references and no text. The path that they ask of the tip is exact, so that each letter
is found by laying it over the path, arc length for arc length: the longest letter that fits first, another one where the rest
of the path then makes no sense. On the way the tip goes straight from letter to letter (`path.lay_out`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from pipelines.model.rigid.body import Array
from pipelines.model.writing.letters import CHARACTERS
from pipelines.model.writing.path import Page, lay_out

__all__ = ["Letter", "pen_down", "read_letters"]

# All lengths here are in heights of a letter.
_OFF = 0.01  # a letter lies on the path to within this
_BENT = 1e-3  # a straight line is left when the path is so far off it
_SKIPPED = 8  # points of a line, 0.002 apart, by which its start may be missed
_STILL = 0.005  # of the largest speed
_POINTS = 97  # of a letter, at which it is laid over the path
_GAP = 0.3  # between letters, by default; a space is as wide, and has a gap of its own
_SPACES = 4  # at most between two letters, counting from none
_FLAT = 1e-6  # [m] a path that is no higher holds no letter
_LONGEST = 200  # letters


@dataclass(frozen=True)
class Letter:
    """One letter, from the sample at which the tip sets out for it to the last that writes it."""

    character: str
    first: int
    last: int
    spaces: int  # before it


@dataclass(frozen=True, eq=False)
class _Form:
    """A letter's own path, strokes and the ways between them."""

    character: str
    width: float
    at: Array  # (points,) arc length
    points: Array  # (points, 2)
    drawn: Array  # (lines and arcs that are drawn, 2) arc length from and to

    @property
    def length(self) -> float:
        return float(self.at[-1])


@cache
def _forms() -> tuple[_Form, ...]:
    """Every letter, the longest first: a P is the beginning of an R."""
    found = []
    for character in CHARACTERS.strip():
        path = lay_out(character, Page(y=0.0, x=0.0, z=0.0, height=1.0))
        at = np.linspace(0.0, path.length, _POINTS)
        piece = np.clip(np.searchsorted(path.starts, at, side="right") - 1, 0, len(path.pieces) - 1)
        points = np.array([path.pieces[k].at(np.array([s - path.starts[k]]))[0][0] for s, k in zip(at, piece, strict=True)])
        drawn = np.concatenate([p.at(np.linspace(0.0, p.length, 33))[0] for p in path.pieces if p.drawn])
        spans = np.array([path.starts[k:k + 2] for k, p in enumerate(path.pieces) if p.drawn])
        found.append(_Form(character, float(np.ptp(drawn[:, 0])), at, points[:, [0, 2]], spans))
    return tuple(sorted(found, key=lambda form: -form.length))


class _Path:
    """The path in its plane, by arc length."""

    def __init__(self, points: Array) -> None:
        step = np.linalg.norm(np.diff(points, axis=0), axis=1)
        self.s = np.concatenate([[0.0], np.cumsum(step)])  # of every sample
        moved = np.concatenate([[True], step > 0.0])
        self._s, self._points = self.s[moved], points[moved]
        self.stops = np.concatenate([[0.0], self.s[1:][step <= _STILL * step.max()], [self.length]])

    @property
    def length(self) -> float:
        return float(self.s[-1])

    def at(self, s: Array) -> Array:
        return np.stack([np.interp(s, self._s, column) for column in self._points.T], axis=-1)

    def holds(self, form: _Form, start: float) -> bool:
        """Return whether `form` lies on the path from `start` on."""
        if start + form.length > self.length + _OFF:
            return False
        here = self.at(start + form.at)
        return bool(np.abs((here - here[0]) - (form.points - form.points[0])).max() <= _OFF)

    def straight_until(self, start: float) -> float:
        """Where the straight line that begins near `start` ends."""
        s = np.arange(start, self.length, 2e-3)
        if len(s) < 4 * _SKIPPED:
            return self.length
        points = self.at(s)
        origin, along = points[_SKIPPED], points[3 * _SKIPPED] - points[_SKIPPED]
        along = along / max(float(np.linalg.norm(along)), 1e-12)
        off = np.abs((points - origin) @ np.array([-along[1], along[0]]))[_SKIPPED:]
        bent = np.flatnonzero(off > _BENT)
        return self.snapped(float(s[_SKIPPED + bent[0] - 1])) if bent.size else self.length

    def snapped(self, s: float) -> float:
        """The corner near `s`, where there is one: the tip stands still in corners."""
        near = self.stops[np.argmin(np.abs(self.stops - s))]
        return float(near) if abs(near - s) < 2.0 * _OFF else s


def read_letters(tip: Array) -> tuple[Letter, ...]:
    """The letters along the reference of a tip (samples, 3) [m]; none where they cannot be told."""
    read = _read(tip)
    return () if read is None else tuple(_in_samples(*read))


def pen_down(tip: Array) -> npt.NDArray[np.bool_] | None:
    """(samples,) where the reference of a tip (samples, 3) [m] writes; not on its way from one stroke to the next, within a letter
    or between two. None where no letters can be told: the path alone then says nothing of a pen."""
    if (read := _read(tip)) is None:
        return None
    path, found = read
    down = np.zeros(len(tip), dtype=bool)
    for form, start, _ in found:
        for first, last in start + form.drawn:
            down |= (path.s >= first) & (path.s <= last)
    lifted = np.abs(tip[:, 1] - np.median(tip[down, 1])) > _BENT * np.ptp(tip[:, 2])  # off the plane, above the end of a stroke
    return np.asarray(down & ~lifted)


_Found = tuple[_Form, float, int]  # letter, where it starts, spaces before it


def _read(tip: Array) -> tuple[_Path, list[_Found]] | None:
    """The path of a tip with all its letters; None where they cannot be told."""
    height = float(np.ptp(tip[:, 2])) if len(tip) else 0.0
    if not np.isfinite(tip).all() or height < _FLAT:
        return None
    path = _Path(tip[:, [0, 2]] / height)
    if path.length > 10.0 * _LONGEST:
        return None
    found = _parse(path)
    return None if found is None else (path, found)


def _parse(path: _Path) -> list[_Found] | None:
    """All letters, depth first; None where there is no reading of the path."""
    stack: list[Iterator[_Found]] = [_next(path, 0.0, None)]
    chosen: list[_Found] = []
    tried: set[float] = set()  # ends from which the rest has no reading
    while stack:
        one = next(stack[-1], None)
        if one is None:
            stack.pop()
            if chosen:
                chosen.pop()
            continue
        end = path.snapped(one[1] + one[0].length)
        if round(end, 2) in tried or len(chosen) >= _LONGEST:
            continue
        tried.add(round(end, 2))
        chosen.append(one)
        if end >= path.length - 2.0 * _OFF:
            return chosen
        stack.append(_next(path, end, one))
    return None


def _next(path: _Path, end: float, before: _Found | None) -> Iterator[_Found]:
    """Every letter that may come next."""
    if before is None:
        yield from ((form, end, 0) for form in _forms() if path.holds(form, end))
        return
    corner = path.straight_until(end)
    right = _right(path, before)
    for form in _forms():
        left = form.points[0, 0] - form.points[:, 0].min()
        for start in dict.fromkeys((corner, end)):
            box = float(path.at(np.array([start]))[0, 0]) - left
            if path.holds(form, start) and box > right - _OFF:
                yield form, start, max(0, round((box - right - _GAP) / (2.0 * _GAP)))
        for spaces in range(_SPACES):  # a way that goes on into the letter without a corner
            box = right + _GAP + 2.0 * _GAP * spaces
            there = np.array([box + left, float(form.points[0, 1] - form.points[:, 1].min()) + _bottom(path)])
            start = end + float(np.linalg.norm(there - path.at(np.array([end]))[0]))
            if start < corner - _BENT and path.holds(form, start):
                yield form, start, spaces


def _right(path: _Path, one: _Found) -> float:
    """The right border of a letter."""
    form, start, _ = one
    return float(path.at(np.array([start]))[0, 0] - form.points[0, 0] + form.points[:, 0].max())


def _bottom(path: _Path) -> float:
    return float(path.at(path.s)[:, 1].min())


def _in_samples(path: _Path, found: list[_Found]) -> Iterator[Letter]:
    """From arc length to samples: a letter's begin where the one before it ended, the last one's end where all is at rest."""
    first = 0
    for k, (form, start, spaces) in enumerate(found):
        end = path.snapped(start + form.length)
        last = len(path.s) - 1 if k == len(found) - 1 else int(np.searchsorted(path.s, end - 1e-12))
        yield Letter(form.character, first, last, spaces)
        first = last + 1
