"""The path of the tip: a text laid out in a vertical plane, piece by piece in closed form.

    path = lay_out("RRRID 2004", Page(y=-0.4, x=0.0, z=0.56, height=0.12))
    position, tangent, curvature = path.pieces[0].at(s)       by arc length s [m], exact

Kostić et al. 2004, Section III.B: a sequence of letters, piecewise in closed form, y fixed. The text reads from left to right
for who looks along y. Between two strokes the tip goes straight, in the plane too unless the page asks to lift it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np

from pipelines.errors import UsageError
from pipelines.model.rigid.body import Array
from pipelines.model.writing.letters import CHARACTERS, Stroke, glyph

__all__ = ["Arc", "Joint", "Line", "Page", "Piece", "TipPath", "lay_out"]

Point = tuple[float, float, float]  # [m] x, y, z in the base frame

_SMOOTH = 1e-9  # tangents this near to each other are one
_SHORTEST = 1e-9  # [m] a move shorter than this is none


@dataclass(frozen=True)
class Page:
    """Where and how large a text is written. The text's middle is at (x, y, z)."""

    y: float = -0.4  # [m] the plane
    x: float = 0.0  # [m]
    z: float = 0.56  # [m]
    height: float = 0.12  # [m] of a letter
    gap: float = 0.3  # between letters, in heights
    lift: float = 0.0  # [m] how far the tip leaves the plane between strokes, towards increasing y

    def __post_init__(self) -> None:
        numbers = (self.y, self.x, self.z, self.height, self.gap, self.lift)
        if not all(map(math.isfinite, numbers)) or self.height <= 0.0 or self.gap < 0.0:
            raise UsageError("C02", "a page needs finite numbers, a height above 0 and a gap of at least 0", where="page",
                             remedy="correct the place or size of the text")


@dataclass(frozen=True)
class Line:
    """A straight line."""

    start: Point
    end: Point

    @cached_property
    def length(self) -> float:  # [m]
        return math.dist(self.start, self.end)

    def at(self, s: Array) -> tuple[Array, Array, Array]:
        """Position [m], unit tangent and curvature vector [1/m], each (samples, 3), at arc length s [m]."""
        direction = (np.array(self.end) - np.array(self.start)) / self.length
        tangent = np.tile(direction, (len(s), 1))
        return np.array(self.start) + s[:, None] * direction, tangent, np.zeros_like(tangent)


@dataclass(frozen=True)
class Arc:
    """A circular arc in a plane of constant y; angles from x towards z."""

    centre: Point
    radius: float  # [m]
    angle: float  # [rad] where it starts
    sweep: float  # [rad] signed

    @property
    def length(self) -> float:  # [m]
        return self.radius * abs(self.sweep)

    def at(self, s: Array) -> tuple[Array, Array, Array]:
        """Position [m], unit tangent and curvature vector [1/m], each (samples, 3), at arc length s [m]."""
        sense = math.copysign(1.0, self.sweep)
        angle = self.angle + sense * s / self.radius
        outward = np.stack([np.cos(angle), np.zeros_like(s), np.sin(angle)], axis=-1)
        tangent = sense * np.stack([-np.sin(angle), np.zeros_like(s), np.cos(angle)], axis=-1)
        return np.array(self.centre) + self.radius * outward, tangent, -outward / self.radius


Joint = Literal["corner", "bend"]  # the direction jumps; only the curvature does


@dataclass(frozen=True)
class Piece:
    """A line or an arc of one letter; `drawn` is false for the move that leads to its next stroke."""

    form: Line | Arc
    letter: int  # its place in the text, counted from 0
    drawn: bool

    @property
    def length(self) -> float:  # [m]
        return self.form.length

    @property
    def radius(self) -> float:  # [m]
        return self.form.radius if isinstance(self.form, Arc) else math.inf

    def at(self, s: Array) -> tuple[Array, Array, Array]:
        """Position [m], unit tangent and curvature vector [1/m], each (samples, 3), at arc length s [m] of the piece."""
        return self.form.at(s)


@dataclass(frozen=True)
class TipPath:
    """The way of the tip, without a gap."""

    text: str
    page: Page
    pieces: tuple[Piece, ...]

    @cached_property
    def starts(self) -> Array:
        """Arc length (pieces + 1,) [m] at which each piece starts, and at which the last one ends."""
        return np.concatenate([[0.0], np.cumsum([piece.length for piece in self.pieces])])

    @property
    def length(self) -> float:  # [m]
        return float(self.starts[-1])

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        """How each piece passes into the next, (pieces - 1,)."""
        return tuple(_joint(one, two) for one, two in pairwise(self.pieces))

    def place(self, letter: int) -> str:
        """In words: "letter 3, 'R', of 'RRRID'"."""
        return f"letter {letter + 1}, '{self.text[letter]}', of '{self.text}'"


def _joint(one: Piece, two: Piece) -> Joint:
    before = one.at(np.array([one.length]))[1]
    after = two.at(np.zeros(1))[1]
    return "corner" if np.linalg.norm(after - before) > _SMOOTH else "bend"


def lay_out(text: str, page: Page) -> TipPath:
    """The path that writes `text` on `page`.

    Raises:
        UsageError: a character has no form here, or nothing is to be drawn.
    """
    for k, character in enumerate(text):
        if glyph(character) is None:
            raise UsageError("C02", f"letter {k + 1} of the text, '{character}', cannot be written", where="text",
                             remedy="write with the letters A to Z, digits and spaces")
    pieces: list[Piece] = []
    at: Point | None = None
    for letter, points in _strokes(text, page):
        moves = _forms(points, page)
        if at is not None:
            pieces += [Piece(form, letter, False) for form in _way(at, _start(moves), page)]
        pieces += [Piece(form, letter, True) for form in moves]
        at = _end(moves[-1])
    if not pieces:
        raise UsageError("C02", "there is nothing to write", where="text", remedy=f"give at least one of {CHARACTERS.strip()}")
    return TipPath(text, page, tuple(pieces))


def _strokes(text: str, page: Page) -> Iterator[tuple[int, Stroke]]:
    """(letter, stroke) with u counted from the middle of the text and w from its half height, in heights."""
    glyphs = [known for character in text if (known := glyph(character)) is not None]
    width = sum(known.width for known in glyphs) + page.gap * (len(glyphs) - 1)
    left = -width / 2
    for letter, known in enumerate(glyphs):
        for stroke in known.strokes:
            yield letter, tuple((left + u, w - 0.5, *sweep) for u, w, *sweep in stroke)
        left += known.width + page.gap


def _forms(stroke: Stroke, page: Page) -> list[Line | Arc]:
    """The lines and arcs of one stroke, each from where the one before it ended."""
    forms: list[Line | Arc] = []
    at = _on(page, *stroke[0])
    for u, w, *sweep in stroke[1:]:
        there = _on(page, u, w)
        if sweep:
            dx, dz = at[0] - there[0], at[2] - there[2]
            forms.append(Arc(there, math.hypot(dx, dz), math.atan2(dz, dx), math.radians(sweep[0])))
        else:
            forms.append(Line(at, there))
        at = _end(forms[-1])
    return forms


def _on(page: Page, u: float, w: float) -> Point:
    return page.x + page.height * u, page.y, page.z + page.height * w


def _way(one: Point, two: Point, page: Page) -> list[Line | Arc]:
    """From the end of a stroke to the start of the next, lifted off the plane where the page asks for it."""
    if math.dist(one, two) <= _SHORTEST:
        return []
    if page.lift == 0.0:
        return [Line(one, two)]
    above = [(x, y + page.lift, z) for x, y, z in (one, two)]
    return [Line(a, b) for a, b in pairwise([one, *above, two])]


def _start(moves: list[Line | Arc]) -> Point:
    return _point(moves[0], 0.0)


def _end(form: Line | Arc) -> Point:
    return form.end if isinstance(form, Line) else _point(form, form.length)


def _point(form: Line | Arc, s: float) -> Point:
    x, y, z = form.at(np.array([s]))[0][0].tolist()
    return x, y, z
