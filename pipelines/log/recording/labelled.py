"""Read text that labels its numbers: log lines of one form, telegrams, and YAML documents.

[14:02:11.254] [rt] q=[0.1, 0.2] tau=[3.0, 4.0]     timestamp, q[0], q[1], tau[0], tau[1]
<Rob><AIPos A1="0.1" A2="0.2"/><IPOC>4</IPOC></Rob>     AIPos.A1, AIPos.A2, IPOC
position: - 0.1 - 0.2 --- (in lines of their own)   position[0], position[1]
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

__all__ = ["LabelledLines", "labelled_lines", "yaml_documents"]

_DATE = r"(?:\d{4}[-/.]\d\d[-/.]\d\d[T ])?\d{1,2}:\d\d:\d\d(?:[.,]\d{1,9})?Z?"
_NUMBER = r"(?<![\w.])[+-]?(?:\d++\.?\d*+|\.\d++)(?:[eE][+-]?\d++)?(?![\w.])|(?<!\w)(?:nan|NaN|[+-]?inf)(?!\w)"
_VALUE = re.compile(rf"{_DATE}|{_NUMBER}")
_SPLIT = re.compile(f"({_VALUE.pattern})")
_MARK = "\0"  # a number's place in a line's form; no text file holds it
_DAY = "\1"
_PIECE = re.compile(rf"[^\W\d][\w.]*|[\[({{<\])}}>]|{_MARK}|{_DAY}")
_LABEL = re.compile(rf"(?<![\w.])[^\W\d][\w.]*+\s*+[=:>]\s*+[\"'\[({{]*{_MARK}")
_SEARCHED = 200  # lines that show the form
_LEAST = 0.9  # of these, behind the first lines, and of all lines, that have one form
_LONGEST = 20_000  # characters of a line
_MOST_FORMS = 1000  # that are remembered; the words of a line may vary


@dataclass(frozen=True)
class LabelledLines:
    """Lines of one form: what their numbers are called, and the numbers as text."""

    names: tuple[str, ...]
    rows: list[tuple[int, list[str]]]  # (line number, one text a name)
    others: int  # lines of another form


def labelled_lines(lines: list[tuple[int, str]]) -> LabelledLines | None:
    """Return the lines whose numbers stand behind labels; None where the text is of another kind."""
    known: dict[str, tuple[str, ...]] = {}

    def names_of(line: str) -> tuple[tuple[str, ...], list[str]]:
        pieces = _SPLIT.split(line)  # words and numbers by turns
        found = pieces[1::2]
        pieces[1::2] = [_DAY if ":" in value else _MARK for value in found]
        form = " ".join("".join(pieces).split())
        names = known[form] if form in known else _names(form)
        if len(known) < _MOST_FORMS:
            known[form] = names
        return names, found

    middle = lines[len(lines) // 4 :][:_SEARCHED]
    if any(len(line) > _LONGEST for _, line in lines):
        return None
    forms = [_VALUE.sub(_MARK, line) for _, line in middle]
    labels = sum(len(_LABEL.findall(form)) for form in forms)
    if labels < 2 * len(forms) or not forms:
        return None
    names, count = Counter(names_of(line)[0] for _, line in middle).most_common(1)[0]
    if count < _LEAST * len(middle) or len(set(names)) < max(len(names), 2):
        return None
    rows = [
        (number, found)
        for number, line in lines
        for said, found in (names_of(line),)
        if said == names
    ]
    return (
        LabelledLines(names, rows, len(lines) - len(rows))
        if len(rows) >= _LEAST * len(lines)
        else None
    )


def _names(form: str) -> tuple[str, ...]:
    """Return the name of each number in a line's form: its label, with the number's place behind a label of several."""
    found: list[str] = []
    labels: list[str] = []  # of the open brackets
    label, tag = "", False
    for piece in _PIECE.findall(form):
        if piece in "[({<":
            labels.append("" if piece == "<" else label)
            tag = piece == "<"
        elif piece in "])}>":
            label = label if piece == ">" else ""
            del labels[-1:]
        elif piece in (_MARK, _DAY):
            prefix = f"{labels[-1]}." if labels and labels[-1] not in ("", label) else ""
            found.append("timestamp" if piece == _DAY else prefix + label)
            label = label if labels and labels[-1] == label else ""
        elif tag:
            labels[-1], tag = piece, False
            label = piece
        else:
            label = piece
    times = Counter(found)
    place: Counter[str] = Counter()
    names = []
    for k, name in enumerate(found):
        names.append(
            f"{name}[{place[name]}]" if name and times[name] > 1 else name or f"column_{k + 1}"
        )
        place[name] += 1
    return tuple(names)


def yaml_documents(data: bytes) -> list[dict[str, Any]] | None:
    """Return YAML documents of mappings and lists of scalars, as `ros2 topic echo` writes them; None where it is no such text."""
    if (
        not re.match(rb"(---\r?\n)?[A-Za-z_]\w*:( \S.*)?\r?\n", data[:300])
        or data.count(b"\n---") < 2
    ):
        return None
    text = data.decode("utf-8", "replace").replace("\r\n", "\n")
    parts = [part for part in re.split(r"(?m)^---[^\S\n]*$", text) if part.strip()]
    return [_document(part) for part in parts]


def _document(text: str) -> dict[str, Any]:
    root: dict[str, Any] = {}
    path: list[tuple[int, dict[str, Any]]] = [(-1, root)]
    last: tuple[dict[str, Any], str] = root, ""
    for indent, item, key, value in _yaml_lines(text):
        if item:
            holder, name = last
            if not isinstance(holder.get(name), list):
                holder[name] = []
            holder[name].append(value)
            continue
        while path[-1][0] >= indent:
            path.pop()
        inner: dict[str, Any] = {}
        path[-1][1][key] = inner if value is None else value
        last = path[-1][1], key
        if value is None:
            path.append((indent, inner))
    return root


def _yaml_lines(text: str) -> Iterator[tuple[int, bool, str, Any]]:
    """Yield (indentation, whether it is an item of a list, key, scalar or None) of each line."""
    for line in text.split("\n"):
        found = re.fullmatch(r"( *)(?:(- )\s*(.*)|([\w/.]+):(?: (.*))?)", line)
        if found is None:
            continue
        value = (found[3] if found[2] else found[5]) or ""
        scalar: Any = value.strip().strip("'\"")
        if _VALUE.fullmatch(value.strip()) and ":" not in value:
            scalar = (
                float(value)
                if "." in value or not value.strip().lstrip("+-").isdecimal()
                else int(value)
            )
        opens = not found[2] and not value.strip()
        yield len(found[1]), bool(found[2]), found[4] or "", None if opens else scalar
