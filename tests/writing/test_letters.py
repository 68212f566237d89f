"""The letters are drawn as letters are: in their boxes, smooth where they should be, with the symmetries they have."""

from __future__ import annotations

import string

import pytest

from pipelines.errors import UsageError
from pipelines.writing.letters import glyphs
from pipelines.writing.path import Page, lay_out

UNIT = Page(y=0.0, x=0.0, z=0.0, height=1.0)


def test_every_letter_and_digit_can_be_written() -> None:
    """A to Z, a to z as capitals, 0 to 9 and the space."""
    assert set(glyphs()) == set(string.ascii_uppercase + string.digits + " ")
    small, capital = (lay_out(text, Page()).pieces for text in (string.ascii_lowercase, string.ascii_uppercase))
    assert small == capital


@pytest.mark.parametrize(("text", "names"), [("RÖD", "letter 2 of the text, 'Ö'"), ("A-B", "'-'"), ("  ", "nothing"),
                                             ("", "nothing")])
def test_what_cannot_be_written_is_named(text: str, names: str) -> None:
    with pytest.raises(UsageError, match=names) as caught:
        lay_out(text, UNIT)
    assert caught.value.code == "RRID-C02"
