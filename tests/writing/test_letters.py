"""The letters are drawn as letters are: in their boxes, smooth where they should be, with the symmetries they have."""

from __future__ import annotations

import math
import string

import numpy as np
import pytest

from pipelines.dynamics.body import Array
from pipelines.errors import UsageError
from pipelines.writing.letters import CHARACTERS, glyph
from pipelines.writing.path import Page, lay_out

UNIT = Page(y=0.0, x=0.0, z=0.0, height=1.0)


def points(character: str) -> Array:
    """The drawn line as points (samples, 2) at most 1/200 apart, the middle of the box at the origin."""
    drawn = [piece for piece in lay_out(character, UNIT).pieces if piece.drawn]
    return np.concatenate([piece.at(np.linspace(0.0, piece.length, math.ceil(200 * piece.length) + 1))[0][:, [0, 2]]
                           for piece in drawn])


def farthest(one: Array, other: Array) -> float:
    """The largest distance from a point of one drawing to the other drawing, both ways."""
    apart = np.linalg.norm(one[:, None] - other[None], axis=-1)
    return float(max(apart.min(axis=0).max(), apart.min(axis=1).max()))


def test_every_letter_and_digit_can_be_written() -> None:
    """A to Z, a to z as capitals, 0 to 9 and the space."""
    assert set(CHARACTERS) == set(string.ascii_uppercase + string.digits + " ")
    assert all(glyph(small) == glyph(small.upper()) for small in string.ascii_lowercase)


@pytest.mark.parametrize("character", CHARACTERS.strip())
def test_a_letter_fills_its_box(character: str) -> None:
    """No piece leaves the box, an arc turned the wrong way would; the letter is as high as the box."""
    known = glyph(character)
    assert known is not None
    drawn = points(character)
    assert np.abs(drawn[:, 0]).max() <= known.width / 2 + 1e-12
    assert np.abs(drawn[:, 1]).max() <= 0.5 + 1e-12
    # two points 1/200 apart on an arc of radius 1/4 miss its top by up to 1/200²/8/(1/4)
    assert np.ptp(drawn[:, 1]) == pytest.approx(1.0, abs=2 * 2 / 200**2 / 4)


@pytest.mark.slow
def test_no_two_characters_look_alike() -> None:
    """O and 0, S and 5, B and 8: each pair differs by at least a twentieth of the height."""
    drawn = {character: points(character) for character in CHARACTERS.strip()}
    names = sorted(drawn)
    alike = [(a, b) for k, a in enumerate(names) for b in names[k + 1:] if farthest(drawn[a], drawn[b]) < 0.049]
    assert alike == []


@pytest.mark.parametrize(("text", "names"), [("RÖD", "letter 2 of the text, 'Ö'"), ("A-B", "'-'"), ("  ", "nothing"),
                                             ("", "nothing")])
def test_what_cannot_be_written_is_named(text: str, names: str) -> None:
    with pytest.raises(UsageError, match=names) as caught:
        lay_out(text, UNIT)
    assert caught.value.code == "RRID-C02"
