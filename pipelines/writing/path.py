"""Lay out a text in a vertical plane, piece by piece in closed form.

    path = lay_out("RRRID 2004", Page(y=-0.4, x=0.0, z=0.56, height=0.12))
    position, tangent, curvature = path.pieces[0].at(s)       by arc length s [m], exact

Kostić et al. 2004, Section III.B. The text reads from left to right when looking along y. Between
two strokes the tip goes straight, in the plane unless the page has a lift.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np

from pipelines.dynamics.body import Array
from pipelines.errors import UsageError
from pipelines.writing.letters import glyphs

__all__ = ["Arc", "Joint", "Line", "Page", "Piece", "TipPath", "lay_out"]

Point = tuple[float, float, float]  # [m] x, y, z in the base frame
Joint = Literal["corner", "bend"]  # the direction jumps; only the curvature does

ROUNDING = 1e-9  # numerics: of unit tangents, and of a move [m]


@dataclass(frozen=True)
class Page:
    """Where and how large a text is written. The text's middle is at (x, y, z)."""

    y: float = -0.4  # [m] the plane
    x: float = 0.0  # [m]
    z: float = 0.56  # [m]
    height: float = 0.12  # [m] of a letter
    gap: float = 0.3  # between letters, in heights
    lift: float = 0.0  # [m] of the tip off the plane between strokes, towards increasing y

    def __post_init__(self) -> None:
        numbers = (self.y, self.x, self.z, self.height, self.gap, self.lift)
        if not all(map(math.isfinite, numbers)) or self.height <= 0.0 or self.gap < 0.0:
            raise UsageError(
                "C02",
                "a page needs finite numbers, a height above 0 and a gap of at least 0",
                where="page",
                remedy="correct the place or size of the text",
            )

    def point(self, u: float, w: float) -> Point:
        """Return the point [m] at (u, w), in heights from the middle of the text."""
        return self.x + self.height * u, self.y, self.z + self.height * w


@dataclass(frozen=True)
class Line:
    """A straight line; `drawn` is false for the move to the next stroke of a letter."""

    start: Point
    end: Point
    letter: int  # its place in the text, counted from 0
    drawn: bool = True
    radius = math.inf  # [m]

    @cached_property
    def length(self) -> float:  # [m]
        return math.dist(self.start, self.end)

    def at(self, s: Array) -> tuple[Array, Array, Array]:
        """Return position [m], tangent and curvature [1/m], (samples, 3), at arc length s [m]."""
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
    letter: int
    drawn: bool = True

    @property
    def length(self) -> float:  # [m]
        return self.radius * abs(self.sweep)

    @property
    def end(self) -> Point:
        x, y, z = self.at(np.array([self.length]))[0][0].tolist()
        return x, y, z

    def at(self, s: Array) -> tuple[Array, Array, Array]:
        """Return position [m], tangent and curvature [1/m], (samples, 3), at arc length s [m]."""
        sense = math.copysign(1.0, self.sweep)
        angle = self.angle + sense * s / self.radius
        outward = np.stack([np.cos(angle), np.zeros_like(s), np.sin(angle)], axis=-1)
        tangent = sense * np.stack([-np.sin(angle), np.zeros_like(s), np.cos(angle)], axis=-1)
        return np.array(self.centre) + self.radius * outward, tangent, -outward / self.radius


Piece = Line | Arc


@dataclass(frozen=True)
class TipPath:
    """The path of the tip, without a gap."""

    text: str
    page: Page
    pieces: tuple[Piece, ...]

    @cached_property
    def starts(self) -> Array:
        """Arc length (pieces + 1,) [m] at the start of each piece, and at the end."""
        return np.concatenate([[0.0], np.cumsum([piece.length for piece in self.pieces])])

    @property
    def length(self) -> float:  # [m]
        return float(self.starts[-1])

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        """How each piece passes into the next, (pieces - 1,)."""
        found: list[Joint] = []
        for one, two in pairwise(self.pieces):
            before, after = one.at(np.array([one.length]))[1], two.at(np.zeros(1))[1]
            found.append("corner" if np.linalg.norm(after - before) > ROUNDING else "bend")
        return tuple(found)

    def place(self, letter: int) -> str:
        """Return "letter 3, 'R', of 'RRRID'"."""
        return f"letter {letter + 1}, '{self.text[letter]}', of '{self.text}'"


def lay_out(text: str, page: Page) -> TipPath:
    """Return the path that writes `text` on `page`.

    Raises:
        UsageError: C02, a character has no form here, or nothing is to be drawn.
    """
    known_forms, forms = glyphs(), []
    for k, character in enumerate(text):
        if (known := known_forms.get(character.upper())) is None:
            raise UsageError(
                "C02",
                f"letter {k + 1} of the text, '{character}', cannot be written",
                where="text",
                remedy="write with the letters A to Z, digits and spaces",
            )
        forms.append(known)
    left = -0.5 * (sum(known.width for known in forms) + page.gap * (len(forms) - 1))
    pieces: list[Piece] = []
    for letter, known in enumerate(forms):
        for stroke in known.strokes:
            at = page.point(left + stroke[0][0], stroke[0][1] - 0.5)
            pieces += _move(pieces, at, letter, page.lift)
            for u, w, *sweep in stroke[1:]:
                there = page.point(left + u, w - 0.5)
                if sweep:
                    dx, dz = at[0] - there[0], at[2] - there[2]
                    pieces.append(
                        Arc(
                            there,
                            math.hypot(dx, dz),
                            math.atan2(dz, dx),
                            math.radians(sweep[0]),
                            letter,
                        )
                    )
                else:
                    pieces.append(Line(at, there, letter))
                at = pieces[-1].end
        left += known.width + page.gap
    if not pieces:
        raise UsageError(
            "C02",
            "there is nothing to write",
            where="text",
            remedy="give at least one letter or digit",
        )
    return TipPath(text, page, tuple(pieces))


def _move(pieces: list[Piece], two: Point, letter: int, lift: float) -> list[Line]:
    """Return the way from the end of a stroke to the start of the next."""
    if not pieces or math.dist(one := pieces[-1].end, two) <= ROUNDING:
        return []
    above = [(x, y + lift, z) for x, y, z in (one, two)] if lift else []
    return [Line(a, b, letter, False) for a, b in pairwise([one, *above, two])]
