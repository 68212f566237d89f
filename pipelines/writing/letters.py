"""Read the forms of capital letters and digits: straight lines and circular arcs, letters.toml."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pipelines.io.sandbox import parse_toml, read_small_text

__all__ = ["Glyph", "Stroke", "glyphs"]

# a start and the pieces that follow: (u, w) a line to this point, (u, w, sweep) an arc about it
Stroke = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Glyph:
    """The width and the strokes of a character, in heights of a letter."""

    width: float
    strokes: tuple[Stroke, ...]


def glyphs() -> dict[str, Glyph]:
    """Return the form of every character that can be written."""
    table = parse_toml(read_small_text(Path(__file__).with_name("letters.toml")))
    return {
        character: Glyph(form["width"], tuple(tuple(map(tuple, one)) for one in form["strokes"]))
        for character, form in table.items()
    }
