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
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pipelines.errors import Check
from pipelines.io.output import write_file
from pipelines.report.document import template
from pipelines.report.report import (
    Figure,
    Report,
    Section,
    Table,
    Tone,
    are_numbers,
    column_texts,
    figures_in,
    filled,
)
from pipelines.report.style import figure_style, format_unit, printable

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.artist import Artist
    from matplotlib.text import Text

__all__ = ["in_short", "render_report", "write_report"]

_WORDS: Final[dict[Tone, str]] = {
    "good": "Good",
    "attention": "Attention",
    "bad": "Problem",
    "neutral": "Result",
}
_PARAGRAPH = 4000  # numerics: characters; longer ones are cut
_SHORT, _LONG = 14, 40  # numerics: characters of a cell that is kept on one line; that gets room
_ONE_SHEET = 12  # numerics: rows of a table that is not broken in print
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
    figures = list(figures_in(report.sections))
    names = _file_names(figure.name for figure in figures)
    files: dict[str, bytes] = {}
    shown: list[dict[str, object]] = []
    for number, (name, figure) in enumerate(zip(names, figures, strict=True), 1):
        svg, png = figure.finished(name) or _draw(figure, name)
        files |= {f"figures/{name}.png": png, f"figures/{name}.svg": svg.encode()}
        caption = _prose(figure.caption)
        shown.append({"caption": caption, "svg": _inline(svg, f"f{number}-", caption)})
    drawn = iter(shown)
    page = template("page.html").render(
        title=printable(report.title),
        verdict=[_prose(line) for line in report.verdict.split("\n")],
        advice=[_prose(line) for line in report.advice],
        tone=report.tone,
        words=_WORDS,
        key_figures=report.key_figures and _table_words(report.key_figures),
        sections=[_section_words(section, drawn) for section in report.sections],
        footer=[(printable(name), _prose(value)) for name, value in footer.items()],
    )
    return {"report.html": page.encode(), **files}


def in_short(report: Report, checks: Sequence[Check] = ()) -> str:
    """Return the verdict, the checks of the inputs, and the key figures as HTML."""
    table = report.key_figures and _table_words(report.key_figures)
    said = [_prose(f"{check.code}: {check.message}") for check in checks if check.level != "ok"]
    verdict = _prose(report.verdict.replace("\n", " "))
    return template("notebook.html").render(verdict=verdict, said=said, table=table)


def _prose(text: object) -> str:
    """Printable text with every number kept on one line with its unit."""
    return _NUMBER_AND_UNIT.sub("\u00a0", printable(text, _PARAGRAPH))


def _section_words(section: Section, drawn: Any) -> dict[str, object]:
    """The section as the page takes it; `drawn` gives the next figure."""
    return {
        "title": printable(section.title),
        "text": [_prose(words) for words in section.text],
        "warning": _prose(section.warning),
        "tables": [_table_words(table) for table in section.tables],
        "figures": [next(drawn) for _ in section.figures],
        "folded": section.folded,
        "parts": [_section_words(part, drawn) for part in section.parts],
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
    rows = zip(zip(*texts, strict=True), tones, strict=True)
    return {
        "caption": _prose(table.caption),
        "columns": columns,
        "tones": bool(table.tones),
        "whole": len(table.rows) <= _ONE_SHEET,
        "rows": [{"cells": cells, "tone": tone} for cells, tone in rows],
    }


def _kind(cells: Sequence[str]) -> str:
    """How a column is set: numbers to the right, what is short on one line, long words wide."""
    longest = max(map(len, cells), default=0)
    if are_numbers(cells):
        return "number"
    return "short" if longest <= _SHORT else "long" if longest > _LONG else "words"


def _file_names(wanted: Iterable[str]) -> list[str]:
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


def _draw(figure: Figure, salt: str) -> tuple[str, bytes]:
    """SVG and PNG of one figure, free of dates and of the text they were drawn from."""
    with figure_style(salt):
        from matplotlib.figure import Figure as Drawing

        drawing = Drawing(figsize=figure.size, layout="constrained")
        figure.draw(drawing)
        for text in _texts(drawing):
            text.set_text("\n".join(map(printable, text.get_text().split("\n"))))
        if (layout := drawing.get_layout_engine()) is not None:
            layout.execute(drawing)
        drawing.set_layout_engine(None)  # laid out once, for both files
        svg, png = io.BytesIO(), io.BytesIO()
        no_dates = dict.fromkeys(("Date", "Creator", "Format", "Type"))
        drawing.savefig(svg, format="svg", metadata=no_dates)
        options = {"compress_level": 3}
        drawing.savefig(png, format="png", metadata={"Software": None}, pil_kwargs=options)
    return _without_ballast(svg.getvalue().decode()), png.getvalue()


def _texts(artist: Artist) -> Iterator[Text]:
    """Every text below `artist` but those beside ticks, which callers make printable."""
    from matplotlib.axis import Axis
    from matplotlib.text import Text

    for child in artist.get_children():
        if isinstance(child, Axis):
            yield child.label
        elif isinstance(child, Text):
            yield child
        else:
            yield from _texts(child)


def _without_ballast(svg: str) -> str:
    """The same picture in fewer bytes: no comments, hundredths of a point, no unused identifier."""
    svg = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    used = set(re.findall(r'(?:href="|url\()#([^")]+)', svg))
    svg = re.sub(r' id="([^"]*)"', lambda found: found[0] if found[1] in used else "", svg)
    svg = re.sub(r' d="([^"]*)"', lambda found: f' d="{_short_path(found[1])}"', svg)
    return re.sub(r">\s+<", "><", svg) + "\n"


def _short_path(path: str) -> str:
    path = re.sub(r"-?\d+\.\d{3,}", lambda number: f"{float(number[0]):.2f}", path)
    return re.sub(r"\s*([A-Za-z])\s*", r"\1", " ".join(path.split()))


def _inline(svg: str, prefix: str, alt: str) -> Markup:
    """`svg` as part of the page, with identifiers of its own."""
    from markupsafe import Markup, escape

    body = svg[svg.index("<svg") :].replace("xlink:href=", "href=")
    # matplotlib's own rule would hold for all of the page; the template has it for drawings alone
    body = re.sub(r"<style.*?</style>", "", body, flags=re.DOTALL)
    box = re.search(r'viewBox="([^"]*)"', body)
    body = body[body.index(">") + 1 :]
    body = re.sub(r'( id="|href="#|url\(#)', rf"\1{prefix}", body)
    head = f'<svg viewBox="{box[1] if box else ""}" role="img" aria-label="{escape(alt)}">'
    return Markup(head + body)  # outlines and numbers only: no text of the report is in the body
