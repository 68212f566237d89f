"""Describe capital letters and digits by straight lines and circular arcs, in a box of height one.

A stroke is drawn without lifting the pen: a start and the pieces that follow, u to the right and
w upwards.

    (u, w)           a straight line to this point; the first one is where the stroke starts
    (u, w, sweep)    an arc about the centre (u, w) by `sweep` degrees, counter-clockwise positive

Where a line meets an arc it is its tangent, except at corners that the letter itself has.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["CHARACTERS", "Glyph", "Stroke", "glyph"]

Stroke = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Glyph:
    """The width and the strokes of a character, in heights of a letter."""

    width: float
    strokes: tuple[Stroke, ...]


# The straight part of 2, 6 and 9 touches a circle of radius 1/4 in a triangle of sides 3, 4 and 5.
_TOUCH = math.degrees(math.atan2(3.0, 4.0))

_P: Stroke = (  # numerics: a form
    (0.0, 0.0),
    (0.0, 1.0),
    (0.35, 1.0),
    (0.35, 0.75, -180.0),
    (0.0, 0.5),
)
_OVAL: Stroke = (
    (0.3, 1.0),
    (0.3, 0.7, 90.0),
    (0.0, 0.3),
    (0.3, 0.3, 180.0),
    (0.6, 0.7),
    (0.3, 0.7, 90.0),
)  # numerics: a form

_GLYPHS = {
    " ": Glyph(0.3, ()),
    "A": Glyph(0.7, (((0.0, 0.0), (0.35, 1.0), (0.7, 0.0)), ((0.14, 0.4), (0.56, 0.4)))),
    "B": Glyph(0.6, ((*_P, (0.35, 0.5), (0.35, 0.25, -180.0), (0.0, 0.0)),)),
    "C": Glyph(0.6, (((0.6, 0.7), (0.3, 0.7, 180.0), (0.0, 0.3), (0.3, 0.3, 180.0)),)),
    "D": Glyph(
        0.6,
        (
            (
                (0.0, 0.0),
                (0.0, 1.0),
                (0.3, 1.0),
                (0.3, 0.7, -90.0),
                (0.6, 0.3),
                (0.3, 0.3, -90.0),
                (0.0, 0.0),
            ),
        ),
    ),
    "E": Glyph(0.6, (((0.6, 1.0), (0.0, 1.0), (0.0, 0.0), (0.6, 0.0)), ((0.0, 0.5), (0.45, 0.5)))),
    "F": Glyph(0.6, (((0.6, 1.0), (0.0, 1.0), (0.0, 0.0)), ((0.0, 0.5), (0.45, 0.5)))),
    "G": Glyph(
        0.6,
        (
            (
                (0.6, 0.7),
                (0.3, 0.7, 180.0),
                (0.0, 0.3),
                (0.3, 0.3, 180.0),
                (0.6, 0.45),
                (0.35, 0.45),
            ),
        ),
    ),
    "H": Glyph(0.6, (((0.0, 1.0), (0.0, 0.0)), ((0.0, 0.5), (0.6, 0.5)), ((0.6, 1.0), (0.6, 0.0)))),
    "I": Glyph(0.1, (((0.05, 1.0), (0.05, 0.0)),)),
    "J": Glyph(0.5, (((0.5, 1.0), (0.5, 0.25), (0.25, 0.25, -180.0)),)),
    "K": Glyph(0.6, (((0.0, 1.0), (0.0, 0.0)), ((0.6, 1.0), (0.0, 0.4)), ((0.2, 0.6), (0.6, 0.0)))),
    "L": Glyph(0.5, (((0.0, 1.0), (0.0, 0.0), (0.5, 0.0)),)),
    "M": Glyph(0.7, (((0.0, 0.0), (0.0, 1.0), (0.35, 0.4), (0.7, 1.0), (0.7, 0.0)),)),
    "N": Glyph(0.6, (((0.0, 0.0), (0.0, 1.0), (0.6, 0.0), (0.6, 1.0)),)),
    "O": Glyph(0.6, (_OVAL,)),
    "P": Glyph(0.6, (_P,)),
    "Q": Glyph(0.6, (_OVAL, ((0.35, 0.25), (0.6, 0.0)))),
    "R": Glyph(0.6, (_P, ((0.25, 0.5), (0.6, 0.0)))),
    "S": Glyph(0.5, (((0.5, 0.75), (0.25, 0.75, 270.0), (0.25, 0.25, -270.0)),)),
    "T": Glyph(0.6, (((0.0, 1.0), (0.6, 1.0)), ((0.3, 1.0), (0.3, 0.0)))),
    "U": Glyph(0.6, (((0.0, 1.0), (0.0, 0.3), (0.3, 0.3, 180.0), (0.6, 1.0)),)),
    "V": Glyph(0.6, (((0.0, 1.0), (0.3, 0.0), (0.6, 1.0)),)),
    "W": Glyph(0.8, (((0.0, 1.0), (0.2, 0.0), (0.4, 0.7), (0.6, 0.0), (0.8, 1.0)),)),
    "X": Glyph(0.6, (((0.0, 0.0), (0.6, 1.0)), ((0.0, 1.0), (0.6, 0.0)))),
    "Y": Glyph(0.6, (((0.0, 1.0), (0.3, 0.5), (0.6, 1.0)), ((0.3, 0.5), (0.3, 0.0)))),
    "Z": Glyph(0.6, (((0.0, 1.0), (0.6, 1.0), (0.0, 0.0), (0.6, 0.0)),)),
    "0": Glyph(
        0.5,
        (
            (
                (0.25, 1.0),
                (0.25, 0.75, 90.0),
                (0.0, 0.25),
                (0.25, 0.25, 180.0),
                (0.5, 0.75),
                (0.25, 0.75, 90.0),
            ),
        ),
    ),
    "1": Glyph(0.25, (((0.0, 0.75), (0.25, 1.0), (0.25, 0.0)),)),
    "2": Glyph(0.5, (((0.0, 0.75), (0.25, 0.75, -180.0 - _TOUCH), (0.0, 0.0), (0.5, 0.0)),)),
    "3": Glyph(0.5, (((0.0, 0.75), (0.25, 0.75, -270.0), (0.25, 0.25, -270.0)),)),
    "4": Glyph(0.55, (((0.4, 0.0), (0.4, 1.0), (0.0, 0.3), (0.55, 0.3)),)),
    "5": Glyph(
        0.5, (((0.5, 1.0), (0.0, 1.0), (0.0, 0.5), (0.25, 0.5), (0.25, 0.25, -180.0), (0.0, 0.0)),)
    ),
    "6": Glyph(0.5, (((0.5, 1.0), (0.05, 0.4), (0.25, 0.25, 360.0)),)),
    "7": Glyph(0.5, (((0.0, 1.0), (0.5, 1.0), (0.15, 0.0)),)),
    "8": Glyph(0.5, (((0.25, 0.5), (0.25, 0.75, 360.0), (0.25, 0.25, -360.0)),)),
    "9": Glyph(0.5, (((0.0, 0.0), (0.45, 0.6), (0.25, 0.75, 360.0)),)),
}

CHARACTERS = "".join(_GLYPHS)


def glyph(character: str) -> Glyph | None:
    """Return the form of a character, of a small letter that of its capital; None without one."""
    return _GLYPHS.get(character.upper())
