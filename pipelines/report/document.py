"""Write a stage's report by its jinja template: the template says all, Python computes.

    document("simulation", "neutral", logs=logs, …)      the report of a stage
    sentence("laws", …)                                  a macro of words.jinja in one string

A template reads like a page. Its lines begin with a sign where they are more than text:

    # Title                the title of the report
    ## Section             a section; ### is one that is closed until the reader opens it
    ! text                 the warning of the section
    > text                 what to look at on the machine
    ~ text                 what the result is based on, for the terminal
    % for log in logs      a statement of jinja
    % do table("joint", "torque [N m]", caption="…")      a table below the words of the section
    % do row(1, 0.3, tone="bad")                          its next row
    % do add(table, caption)                              a table that Python made
    % do figure(one)                                      a figure below the tables

Text and the first table before the first section are the verdict and the key figures. A blank line
ends a paragraph, a paragraph of the verdict is one line of it. Sections and tables without content
are left out. What a log contains is printed on one line without control characters, so that it is
never one of these signs, and escaped in the page.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipelines.errors import clean
from pipelines.report.report import Cell, Figure, Report, Section, Table, Tone
from pipelines.report.style import enumerated, format_number, format_unit, unit_in_words, with_std

if TYPE_CHECKING:
    import jinja2

__all__ = ["as_sentence", "capital", "document", "sections_of", "sentence", "template"]

# control characters that separate records, sections and signs: no value holds one
_PARAGRAPH, _HEADING, _SIGN = "\x1e", "\x1d", "\x1c"


class _Page:
    """The sections, tables and figures that a template adds while it is rendered."""

    def __init__(self) -> None:
        self.sections = [Section("")]

    def begin(self, folded: bool) -> None:
        self.sections.append(Section("", folded=folded))

    def table(
        self, *columns: str, caption: str = "", rows: Iterable[Any] = (), keeps_empty: bool = False
    ) -> None:
        given = tuple(map(tuple, rows))
        self._add(tables=(Table(columns, given, _on_one_line(caption), (), keeps_empty),))

    def row(self, *cells: Cell, tone: Tone | None = None) -> None:
        section = self.sections[-1]
        *others, last = section.tables
        tones = (*last.tones, tone) if tone else last.tones
        own = (_on_one_line(c) if isinstance(c, str) and "\n" in c else c for c in cells)
        last = replace(last, rows=(*last.rows, tuple(own)), tones=tones)
        self.sections[-1] = replace(section, tables=(*others, last))

    def add(self, table: Table, caption: str = "") -> None:
        self._add(tables=(replace(table, caption=_on_one_line(caption)),))

    def fold(self, folded: bool) -> None:
        self.sections[-1] = replace(self.sections[-1], folded=folded)

    def figure(self, *figures: Figure) -> None:
        self._add(figures=figures)

    def _add(self, **more: tuple[Any, ...]) -> None:
        section = self.sections[-1]
        changes: dict[str, Any] = {
            name: (*getattr(section, name), *items) for name, items in more.items()
        }
        self.sections[-1] = replace(section, **changes)


def document(stage: str, tone: Tone = "neutral", **context: Any) -> Report:
    """Return the report that the template of `stage` makes of `context`."""
    words, sections = _rendered(stage, context)
    said = words[0]
    head, *shown = sections
    key = next(iter(head.tables), None)
    title, verdict = " ".join(said["#"]), "\n".join(said[""])
    basis = tuple(line for part in words for line in part["~"])
    kept = tuple(one for one in shown if one.text or one.tables or one.figures or one.warning)
    return Report(title, verdict, tone, key, kept, tuple(said[">"]), basis)


def sections_of(stage: str, **context: Any) -> tuple[Section, ...]:
    """Return the sections alone that the template of `stage` makes of `context`."""
    return document(stage, **context).sections


def _rendered(
    stage: str, context: dict[str, Any]
) -> tuple[list[dict[str, list[str]]], list[Section]]:
    """Return the paragraphs of every section by their signs, and the sections."""
    page = _Page()
    names = ("begin", "fold", "table", "row", "add", "figure")
    adding = {name: getattr(page, name) for name in names}
    text = template(f"{stage}.jinja").render(context | adding)
    first, *rest = text.split(_HEADING)
    words, sections = [_paragraphs(first)], [_shown(page.sections[0], "", {})]
    for title, body, section in zip(rest[::2], rest[1::2], page.sections[1:], strict=True):
        words.append(_paragraphs(body))
        sections.append(_shown(section, _on_one_line(title), words[-1]))
    return words, sections


def _shown(section: Section, title: str, said: Mapping[str, list[str]]) -> Section:
    tables = tuple(table for table in section.tables if table.rows)
    text, warning = tuple(said.get("", ())), " ".join(said.get("!", ()))
    return replace(section, title=title, text=text, tables=tables, warning=warning)


def _paragraphs(text: str) -> dict[str, list[str]]:
    """Return the paragraphs by the sign they begin with, "" for plain ones."""
    found: dict[str, list[str]] = {sign: [] for sign in ("", "#", "!", ">", "~")}
    for part in map(_on_one_line, text.split(_PARAGRAPH)):
        sign = part[1:2] if part.startswith(_SIGN) else ""
        words = part[2:].strip() if sign else part
        if words:
            found[sign].append(words)
    return found


def sentence(macro: str, *values: Any, **named: Any) -> str:
    """Return the text of a macro of words.jinja on a single line."""
    said: str = getattr(template("words.jinja").module, macro)(*values, **named)
    return _on_one_line(said.replace(_PARAGRAPH, " "))


@cache
def template(name: str) -> jinja2.Template:
    """A template of this package: a page (.html), or the words of a stage (.jinja)."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(_source),
        autoescape=name.endswith(".html"),  # words are escaped where they enter the page
        finalize=None if name.endswith(".html") else _inert,
        undefined=jinja2.StrictUndefined,
        extensions=["jinja2.ext.do"],
        keep_trailing_newline=True,
    )
    environment.filters |= {
        "num": format_number,
        "nums": _numbers,
        "percent": _percent,
        "std": _with_its_std,
        "unit": format_unit,
        "spoken_unit": unit_in_words,
        "enumerated": enumerated,
        "capital": capital,
        "as_sentence": as_sentence,
    }
    environment.globals |= {"with_std": with_std}
    return environment.get_template(name)


def _source(name: str) -> str:
    """A template with its blank lines, headings and signs marked, its statement lines as tags.

    Jinja's own statement lines would eat the blank lines behind them.
    """
    text = _read(name)
    if name.endswith(".html"):
        return text
    text = re.sub(r"\n\n+", f"\n{_PARAGRAPH}\n", text)
    for signs, folded in (("###", "true"), ("##", "false")):
        heading = rf"{{% do begin({folded}) %}}{_HEADING}\1{_HEADING}"
        text = re.sub(rf"^{signs} (.*)$", heading, text, flags=re.MULTILINE)
    text = re.sub(r"^([#!>~]) ", rf"{_PARAGRAPH}{_SIGN}\1", text, flags=re.MULTILINE)
    return re.sub(r"^% (.*)\n", r"{% \1 %}", text, flags=re.MULTILINE)


def _read(name: str) -> str:
    return (Path(__file__).parent / "templates" / name).read_text(encoding="utf-8")


def _inert(value: Any) -> Any:
    """Return what an expression prints without line breaks and control characters."""
    if not isinstance(value, str):
        return value
    before, behind = (" " * end.isspace() for end in (value[:1], value[-1:]))
    return before + clean(value, None) + behind


def _on_one_line(text: str) -> str:
    """Return text without line breaks, and without spaces before commas or inside brackets."""
    text = re.sub("[ \n]+", " ", text).strip(" ")
    return re.sub(r" (?=[,;:)]|[.](?:\s|$))|(?<=\() ", "", text)


def capital(words: str) -> str:
    """`words` as the beginning of a sentence."""
    return words[:1].upper() + words[1:]


def as_sentence(text: str) -> str:
    """`text` as a sentence: it begins large and ends in a full stop; nothing of nothing."""
    text = capital(text.strip())
    return text if text.endswith((".", "!", "?")) or not text else f"{text}."


def _numbers(values: Iterable[float], digits: int = 2) -> str:
    """ "0.1, 0.2, 0.3", joint by joint."""
    return ", ".join(format_number(float(x), digits) for x in values)


def _percent(share: float, digits: int = 2) -> str:
    return f"{format_number(100.0 * share, digits)} %"


def _with_its_std(value: Any) -> str:
    return with_std(value.value, value.std)
