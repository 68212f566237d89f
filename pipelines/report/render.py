"""Turn a report into one HTML file that opens anywhere, and its figures as SVG and PNG.

The page holds everything inside itself and runs nothing: no script, no address to load from, and a content security
policy that forbids both. Equal reports give equal bytes. Text may come from logs of unknown origin: it is made
printable here, once, and escaped by jinja2; figures hold no text at all, only outlines of letters.
"""

from __future__ import annotations

import hashlib
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pipelines.log.atomic import write_file
from pipelines.report.cells import are_numbers, column_texts, filled
from pipelines.report.report import Figure, Report, Section, Table, Tone
from pipelines.report.settled import settle
from pipelines.report.side_by_side import Picture, drawn
from pipelines.report.style import figure_style, format_unit, printable

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure as Drawing
    from matplotlib.text import Text

__all__ = ["render_report", "write_report"]

_WORDS: Final[dict[Tone, str]] = {"good": "Good", "attention": "Attention", "bad": "Problem", "neutral": "Result"}
_PARAGRAPH = 4000  # characters; longer ones are cut
_NUMBER_AND_UNIT = re.compile(r"(?<=[\d⁰¹²³⁴⁵⁶⁷⁸⁹]) (?=(%|°C|[mµnk]?(s|Hz|N|m|rad|g|A|V|W)\b|(min|deg|rev)\b))|(?<=\bN) (?=m\b)"
                              r"|(?<=[\d)]) (?=[±×] [\d∞])|(?<=[±×]) (?=[\d∞])")


def write_report(report: Report, folder: Path, footer: Mapping[str, str]) -> list[Path]:
    """Write report.html and figures/ into `folder`; each file is there whole or not at all.

    Args:
        footer: where the report comes from, name by name: command, version, inputs with their SHA-256.
    """
    written = []
    for name, content in render_report(report, footer).items():
        written.append(folder / name)
        write_file(written[-1], partial(_put, content))
    return written


def render_report(report: Report, footer: Mapping[str, str]) -> dict[str, bytes]:
    """The files of a report by their names, "report.html" first; nothing is written."""
    pictures, names = _pictures(report), _Names()
    files: dict[str, bytes] = {}
    sections, glyphs = list[dict[str, object]](), set[str]()
    for section in report.sections:
        figures = []
        for figure in section.figures:
            name = names.unique(figure.name)
            svg, files[f"figures/{name}.png"] = pictures[name]
            files[f"figures/{name}.svg"] = svg.encode()
            figures.append({"caption": _prose(figure.caption),
                            "svg": _inline(svg, f"f{len(names.taken)}-", figure.alt or figure.caption, glyphs)})
        sections.append(_section_words(section) | {"figures": figures, "n": len(sections) + 1, "leads": section.leads})
    page = _template().render(
        title=printable(report.title), verdict=_prose(report.verdict), advice=[_prose(line) for line in report.advice],
        tone=report.tone, words=_WORDS, key_figures=report.key_figures and _table_words(report.key_figures), sections=sections,
        contents=_contents([printable(section.title) for section in report.sections]),
        footer=[(printable(name), _prose(value)) for name, value in footer.items()])
    return {"report.html": page.encode(), **files}


def _pictures(report: Report) -> dict[str, Picture]:
    """Every figure's picture by the name of its file; what was drawn before is taken back."""
    names = _Names()
    named = {names.unique(figure.name): figure for section in report.sections for figure in section.figures}
    found = {name: figure.finished(name) for name, figure in named.items()}
    missing = drawn({name: figure for name, figure in named.items() if found[name] is None}, _draw)
    return {name: picture or missing[name] for name, picture in found.items()}


def _put(content: bytes, path: Path) -> None:
    path.write_bytes(content)


def _template() -> Any:
    import jinja2

    folder = jinja2.FileSystemLoader(Path(__file__).parent)
    environment = jinja2.Environment(loader=folder, autoescape=True, undefined=jinja2.StrictUndefined,
                                     keep_trailing_newline=True)
    return environment.get_template("template.html")


def _prose(text: object) -> str:
    """Printable text with every number kept on one line with its unit."""
    return _NUMBER_AND_UNIT.sub("\u00a0", printable(text, _PARAGRAPH))


def _contents(titles: Sequence[str]) -> list[dict[str, object]]:
    """Links to all sections; sections in a row whose titles begin alike, "diagnose: …", share one line."""
    from itertools import groupby

    parts: list[dict[str, object]] = []
    for beginning, some in groupby(enumerate(titles, 1), key=lambda one: one[1].partition(": ")[0] if ": " in one[1] else ""):
        links = list(some)
        shared = beginning if len(links) > 1 else ""
        parts.append({"of": shared, "links": [(n, title.partition(": ")[2] if shared else title) for n, title in links]})
    return parts


def _section_words(section: Section) -> dict[str, object]:
    return {"title": printable(section.title), "text": [_prose(words) for words in section.text],
            "warning": _prose(section.warning), "tables": [_table_words(table) for table in section.tables]}


def _table_words(table: Table) -> dict[str, object]:
    """Cells as text, with the kind of each column."""
    table = filled(table)
    rows = list(zip(*(column_texts(cells, _prose) for cells in zip(*table.rows, strict=True)), strict=True))
    columns = []
    for place, heading in enumerate(table.columns):
        name, bracket, unit = printable(heading).partition(" [")
        columns.append({"name": name, "unit": format_unit(unit.removesuffix("]")) if bracket else "",
                        "kind": _kind([row[place] for row in rows])})
    tones = table.tones or (None,) * len(rows)
    return {"caption": _prose(table.caption), "columns": columns, "tones": bool(table.tones),
            "whole": len(rows) <= 12,  # kept on one sheet of paper
            "stacks": len(columns) <= 3 and not (table.tones or any(column["unit"] for column in columns)),  # on a phone
            "rows": [{"cells": cells, "tone": tone} for cells, tone in zip(rows, tones, strict=True)]}


def _kind(cells: Sequence[str]) -> str:
    """How a column is set: numbers to the right, what is short on one line, long words with room."""
    if are_numbers(cells):
        return "number"
    if all(len(cell) <= (30 if cell[:1].isdigit() or cell[:1] in "(−±" else 14) for cell in cells):
        return "short"
    return "long" if any(len(cell) > 40 for cell in cells) else "words"


class _Names:
    """File names that are safe on every system and never given twice."""

    def __init__(self) -> None:
        self.taken: set[str] = set()

    def unique(self, wanted: str) -> str:
        name = re.sub(r"[^A-Za-z0-9_-]+", "-", wanted)[:60].strip("-") or "figure"
        if name != wanted:
            name += "-" + hashlib.sha256(wanted.encode("utf-8", "replace")).hexdigest()[:8]
        free, count = name, 1
        while free.lower() in self.taken:
            count += 1
            free = f"{name}-{count}"
        self.taken.add(free.lower())
        return free


def _draw(figure: Figure, salt: str) -> tuple[str, bytes]:
    """SVG and PNG of one figure, free of dates and of the text they were drawn from."""
    with figure_style(salt):
        from matplotlib.figure import Figure as Drawing

        drawing = Drawing(figsize=figure.size, layout="constrained")
        figure.draw(drawing)
        _make_printable(drawing)
        settle(drawing)
        if (layout := drawing.get_layout_engine()) is not None:
            layout.execute(drawing)
        drawing.set_layout_engine(None)  # already laid out: both shall be the same picture, with no trial drawing before them
        svg, png = io.BytesIO(), io.BytesIO()
        drawing.savefig(svg, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
        drawing.savefig(png, format="png", metadata={"Software": None}, pil_kwargs={"compress_level": 3})
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
    """The same picture in fewer bytes: no comments, hundredths of a point, identifiers only where one is used."""
    svg = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    used = set(re.findall(r'(?:href="|url\()#([^")]+)', svg))
    svg = re.sub(r' id="([^"]*)"', lambda found: found[0] if found[1] in used else "", svg)
    svg = re.sub(r' d="([^"]*)"', lambda found: f' d="{_short_path(found[1])}"', svg)
    return re.sub(r">\s+<", "><", svg) + "\n"


def _short_path(path: str) -> str:
    path = re.sub(r"-?\d+\.\d{3,}", lambda number: f"{float(number[0]):.2f}".rstrip("0").rstrip("."), path)
    return re.sub(r"\s*([A-Za-z])\s*", r"\1", " ".join(path.split()))


def _inline(svg: str, prefix: str, alt: str, glyphs: set[str]) -> Any:
    """`svg` as part of the page: identifiers of its own, letters shared with the figures above it."""
    from markupsafe import Markup, escape

    def define(found: re.Match[str]) -> str:
        known = found[1] in glyphs
        glyphs.add(found[1])
        return "" if known else found[0]

    body = svg[svg.index("<svg"):].replace("xlink:href=", "href=")
    # matplotlib's own rule would hold for every element of the page; the template has it for drawings alone
    body = re.sub(r"<style.*?</style>", "", body, flags=re.DOTALL)
    box = re.search(r'viewBox="([^"]*)"', body)
    body = body[body.index(">") + 1:]
    # letters are named after font and glyph, equal names are equal outlines
    body = re.sub(r'<path id="([A-Za-z][\w.-]*-[0-9a-f]+)"[^>]*transform="scale\(0\.015625\)"/>', define, body)
    body = re.sub(r'( id="|href="#|url\(#)([^")]+)',
                  lambda found: found[0] if found[2] in glyphs else found[1] + prefix + found[2], body)
    body = body.replace("<defs></defs>", "").replace("<defs/>", "").strip()
    head = f'<svg viewBox="{box[1] if box else ""}" role="img" aria-label="{escape(printable(alt))}">'
    return Markup(head + body)  # outlines and numbers only: no text of the report is in the body
