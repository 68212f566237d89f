"""Turn a report into one HTML file that opens anywhere, and its figures as SVG and PNG.

The page holds everything inside itself and runs nothing: no script, no address to load from, and a
content security policy that forbids both. Equal reports give equal bytes. Text may come from logs
of unknown origin: it is made printable here, once, and escaped by jinja2; figures hold no text at
all, only outlines of letters.
"""

from __future__ import annotations

import hashlib
import io
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pipelines.errors import Check
from pipelines.io.output import write_file
from pipelines.report.report import (
    Figure,
    Report,
    Section,
    Table,
    Tone,
    are_numbers,
    column_texts,
    filled,
)
from pipelines.report.sentences import template
from pipelines.report.style import figure_style, format_unit, printable

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure as Drawing
    from matplotlib.text import Text

__all__ = ["Picture", "drawn", "in_short", "render_report", "write_report"]

Picture = tuple[str, bytes]  # SVG and PNG

_WORDS: Final[dict[Tone, str]] = {
    "good": "Good",
    "attention": "Attention",
    "bad": "Problem",
    "neutral": "Result",
}
_PARAGRAPH = 4000  # numerics: characters; longer ones are cut
_NUMBER_AND_UNIT = re.compile(
    r"(?<=[\d⁰¹²³⁴⁵⁶⁷⁸⁹]) (?=(%|°C|[mµnk]?(s|Hz|N|m|rad|g|A|V|W)\b|(min|deg|rev)\b))"
    r"|(?<=\bN) (?=m\b)|(?<=[\d)]) (?=[±×] [\d∞])|(?<=[±×]) (?=[\d∞])"
)


def write_report(report: Report, folder: Path, footer: Mapping[str, str]) -> list[Path]:
    """Write report.html and figures/ into `folder`; each file is there whole or not at all.

    Args:
        footer: where the report comes from, by name: command, version, inputs with their SHA-256.
    """
    written = []
    for name, content in render_report(report, footer).items():
        written.append(folder / name)
        write_file(written[-1], partial(_put, content))
    return written


def _put(content: bytes, path: Path) -> None:
    path.write_bytes(content)


def render_report(report: Report, footer: Mapping[str, str]) -> dict[str, bytes]:
    """The files of a report by their names, "report.html" first; nothing is written."""
    names = iter(_file_names(f.name for section in report.sections for f in section.figures))
    named = [[(next(names), figure) for figure in s.figures] for s in report.sections]
    pictures = _pictures({name: figure for figures in named for name, figure in figures})
    files: dict[str, bytes] = {}
    sections: list[dict[str, object]] = []
    glyphs: set[str] = set()
    for section, figures in zip(report.sections, named, strict=True):
        shown = []
        for name, figure in figures:
            svg, files[f"figures/{name}.png"] = pictures[name]
            files[f"figures/{name}.svg"] = svg.encode()
            alt = figure.alt or figure.caption
            inline = _inline(svg, f"f{len(files) // 2}-", alt, glyphs)
            shown.append({"caption": _prose(figure.caption), "svg": inline})
        sections.append(_section_words(section) | {"figures": shown, "n": len(sections) + 1})
    page = template("page.html").render(
        title=printable(report.title),
        verdict=[_prose(line) for line in report.verdict.split("\n")],
        advice=[_prose(line) for line in report.advice],
        tone=report.tone,
        words=_WORDS,
        key_figures=report.key_figures and _table_words(report.key_figures),
        sections=sections,
        contents=_contents([printable(section.title) for section in report.sections]),
        footer=[(printable(name), _prose(value)) for name, value in footer.items()],
    )
    return {"report.html": page.encode(), **files}


def in_short(report: Report, checks: Sequence[Check] = ()) -> str:
    """Return the verdict, the checks of the inputs, and the key figures as HTML."""
    table = report.key_figures and _table_words(report.key_figures)
    said = [_prose(f"{check.code}: {check.message}") for check in checks if check.level != "ok"]
    verdict = _prose(report.verdict.replace("\n", " "))
    return template("notebook.html").render(verdict=verdict, said=said, table=table)


def _pictures(figures: Mapping[str, Figure]) -> dict[str, Picture]:
    """Every figure's picture by the name of its file; what was drawn before is not drawn again."""
    found = {name: figure.finished(name) for name, figure in figures.items()}
    missing = drawn({name: figures[name] for name in figures if found[name] is None}, _draw)
    return {name: picture or missing[name] for name, picture in found.items()}


def drawn(
    figures: Mapping[str, Figure], draw: Callable[[Figure, str], Picture]
) -> dict[str, Picture]:
    """Return `draw(figure, name)` of each figure."""
    return {name: draw(figure, name) for name, figure in figures.items()}


def _prose(text: object) -> str:
    """Printable text with every number kept on one line with its unit."""
    return _NUMBER_AND_UNIT.sub("\u00a0", printable(text, _PARAGRAPH))


def _contents(titles: Sequence[str]) -> list[dict[str, object]]:
    """Links to all sections; sections in a row that begin alike, "diagnose: …", share one line."""
    parts: list[dict[str, object]] = []

    def stage(item: tuple[int, str]) -> str:
        return item[1].partition(": ")[0] if ": " in item[1] else ""

    for beginning, group in groupby(enumerate(titles, 1), key=stage):
        links = list(group)
        shared = beginning if len(links) > 1 else ""
        ends = [(n, title.partition(": ")[2] if shared else title) for n, title in links]
        parts.append({"of": shared, "links": ends})
    return parts


def _section_words(section: Section) -> dict[str, object]:
    return {
        "title": printable(section.title),
        "text": [_prose(words) for words in section.text],
        "warning": _prose(section.warning),
        "tables": [_table_words(table) for table in section.tables],
        "leads": section.leads,
        "folded": section.folded,
    }


def _table_words(table: Table) -> dict[str, object]:
    """Cells as text, with the kind of each column."""
    table = filled(table)
    texts = [column_texts(cells, _prose) for cells in zip(*table.rows, strict=True)]
    columns = []
    for heading, cells in zip(table.columns, texts or [[]] * len(table.columns), strict=True):
        name, bracket, unit = printable(heading).partition(" [")
        unit = format_unit(unit.removesuffix("]")) if bracket else ""
        columns.append({"name": name, "unit": unit, "kind": _kind(cells)})
    tones = table.tones or (None,) * len(table.rows)
    narrow = len(columns) <= 3 and not (table.tones or any(c["unit"] for c in columns))
    return {
        "caption": _prose(table.caption),
        "columns": columns,
        "tones": bool(table.tones),
        "whole": len(table.rows) <= 12,  # kept on one sheet of paper
        "stacks": narrow,  # on a phone
        "rows": [
            {"cells": cells, "tone": tone}
            for cells, tone in zip(zip(*texts, strict=True), tones, strict=True)
        ],
    }


def _kind(cells: Sequence[str]) -> str:
    """How a column is set: numbers to the right, what is short on one line, long words wide."""
    if are_numbers(cells):
        return "number"
    numeric = [cell[:1].isdigit() or cell[:1] in "(−±" for cell in cells]
    if all(len(cell) <= (30 if n else 14) for cell, n in zip(cells, numeric, strict=True)):
        return "short"
    return "long" if any(len(cell) > 40 for cell in cells) else "words"


def _file_names(wanted: Iterator[str]) -> list[str]:
    """File names that are safe on every system, and no two alike."""
    taken: dict[str, str] = {}  # in lower case -> as it is
    for original in wanted:
        name = re.sub(r"[^A-Za-z0-9_-]+", "-", original)[:60].strip("-") or "figure"
        if name != original:
            name += "-" + hashlib.sha256(original.encode("utf-8", "replace")).hexdigest()[:8]
        free, count = name, 1
        while free.lower() in taken:
            count += 1
            free = f"{name}-{count}"
        taken[free.lower()] = free
    return list(taken.values())


def _draw(figure: Figure, salt: str) -> Picture:
    """SVG and PNG of one figure, free of dates and of the text they were drawn from."""
    with figure_style(salt):
        from matplotlib.figure import Figure as Drawing

        drawing = Drawing(figsize=figure.size, layout="constrained")
        figure.draw(drawing)
        _make_printable(drawing)
        if (layout := drawing.get_layout_engine()) is not None:
            layout.execute(drawing)
        drawing.set_layout_engine(None)  # laid out once, for both files
        svg, png = io.BytesIO(), io.BytesIO()
        no_dates = dict.fromkeys(("Date", "Creator", "Format", "Type"))
        drawing.savefig(svg, format="svg", metadata=no_dates)
        options = {"compress_level": 3}
        drawing.savefig(png, format="png", metadata={"Software": None}, pil_kwargs=options)
    return _without_ballast(svg.getvalue().decode()), png.getvalue()


def _make_printable(drawing: Drawing) -> None:
    for text in _texts(drawing):
        if words := text.get_text():
            text.set_text("\n".join(printable(line) for line in words.split("\n")))


def _texts(artist: Artist) -> Iterator[Text]:
    """Every text below `artist` but numbers beside ticks, which are made when they are drawn."""
    from matplotlib.axis import Axis
    from matplotlib.text import Text
    from matplotlib.ticker import FixedFormatter

    for child in artist.get_children():
        if isinstance(child, Axis):
            yield child.label
            if not isinstance(child.get_major_formatter(), FixedFormatter):
                continue
        if isinstance(child, Text):
            yield child
        yield from _texts(child)


def _without_ballast(svg: str) -> str:
    """The same picture in fewer bytes: no comments, hundredths of a point, no unused identifier."""
    svg = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    used = set(re.findall(r'(?:href="|url\()#([^")]+)', svg))
    svg = re.sub(r' id="([^"]*)"', lambda found: found[0] if found[1] in used else "", svg)
    svg = re.sub(r' d="([^"]*)"', lambda found: f' d="{_short_path(found[1])}"', svg)
    return re.sub(r">\s+<", "><", svg) + "\n"


def _short_path(path: str) -> str:
    def hundredths(number: re.Match[str]) -> str:
        return f"{float(number[0]):.2f}".rstrip("0").rstrip(".")

    path = re.sub(r"-?\d+\.\d{3,}", hundredths, path)
    return re.sub(r"\s*([A-Za-z])\s*", r"\1", " ".join(path.split()))


def _inline(svg: str, prefix: str, alt: str, glyphs: set[str]) -> Any:
    """`svg` as part of the page: its own identifiers, letters shared with the figures above it."""
    from markupsafe import Markup, escape

    def define(found: re.Match[str]) -> str:
        known = found[1] in glyphs
        glyphs.add(found[1])
        return "" if known else found[0]

    def own(found: re.Match[str]) -> str:
        return found[0] if found[2] in glyphs else found[1] + prefix + found[2]

    body = svg[svg.index("<svg") :].replace("xlink:href=", "href=")
    # matplotlib's own rule would hold for all of the page; the template has it for drawings alone
    body = re.sub(r"<style.*?</style>", "", body, flags=re.DOTALL)
    box = re.search(r'viewBox="([^"]*)"', body)
    body = body[body.index(">") + 1 :]
    # letters are named after font and glyph, equal names are equal outlines
    letter = r'<path id="([A-Za-z][\w.-]*-[0-9a-f]+)"[^>]*transform="scale\(0\.015625\)"/>'
    body = re.sub(r'( id="|href="#|url\(#)([^")]+)', own, re.sub(letter, define, body))
    body = body.replace("<defs></defs>", "").replace("<defs/>", "").strip()
    label = escape(printable(alt))
    head = f'<svg viewBox="{box[1] if box else ""}" role="img" aria-label="{label}">'
    return Markup(head + body)  # outlines and numbers only: no text of the report is in the body
