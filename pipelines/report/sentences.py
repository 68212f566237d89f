"""The sentences of the reports: one jinja template a stage, a macro for what is said in one place.

    paragraphs("frf", "verdict", ...)       ("The base resonates at 28 Hz.", ...), one a paragraph
    sentence("frf", "verdict", ...)         the same in one string

In a template a line that begins with "%" is a statement, a blank line ends a paragraph, and line
breaks are spaces, with none left before punctuation. What is computed is computed in Python: a
template chooses words and formats numbers.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipelines.report.style import enumerated, format_number, format_unit, with_std

if TYPE_CHECKING:
    import jinja2

__all__ = ["capital", "paragraphs", "sentence", "template"]

_PARAGRAPH = "\x1e"  # the control character that separates records: no template holds it


def paragraphs(stage: str, macro: str, *values: Any, **named: Any) -> tuple[str, ...]:
    """Return the text of a macro of the template of `stage`, paragraph by paragraph."""
    said: str = getattr(template(f"{stage}.jinja").module, macro)(*values, **named)
    return tuple(part for part in map(_on_one_line, said.split(_PARAGRAPH)) if part)


def sentence(stage: str, macro: str, *values: Any, **named: Any) -> str:
    """Return the text of a macro of the template of `stage` as one paragraph."""
    return " ".join(paragraphs(stage, macro, *values, **named))


@cache
def template(name: str) -> jinja2.Template:
    """A template of this package: `page.html`, or the sentences of a stage."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(_source),
        autoescape=name.endswith(".html"),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
    )
    environment.filters |= {
        "num": format_number,
        "nums": format_numbers,
        "percent": _percent,
        "std": _with_its_std,
        "unit": format_unit,
        "enumerated": enumerated,
        "capital": capital,
        "as_sentence": as_sentence,
    }
    environment.globals |= {"with_std": with_std}
    return environment.get_template(name)


def _source(name: str) -> str:
    """A template with its blank lines marked, and its statement lines as jinja tags.

    Jinja's own statement lines would eat the blank lines behind them.
    """
    text = (Path(__file__).parent / "templates" / name).read_text(encoding="utf-8")
    if name.endswith(".html"):
        return text
    text = re.sub(r"\n\n+", f"\n{_PARAGRAPH}\n", text)
    return re.sub(r"^% (.*)\n", r"{% \1 %}", text, flags=re.MULTILINE)


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


def format_numbers(values: Iterable[float], digits: int = 2) -> str:
    """ "0.1, 0.2, 0.3", joint by joint."""
    return ", ".join(format_number(float(x), digits) for x in values)


def _percent(share: float, digits: int = 2) -> str:
    return f"{format_number(100.0 * share, digits)} %"


def _with_its_std(value: Any) -> str:
    return with_std(value.value, value.std)
