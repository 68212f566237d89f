"""Who reads a report, a message, a help page or a schema is told which publication an equation, a table or a figure is of."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from rrrid_cli.app import STAGES, schema_of

REPO = Path(__file__).resolve().parents[1]
FILES = sorted(path for folder in ("pipelines", "rrrid_cli") for path in (REPO / folder).rglob("*.py"))
REFERENCE = re.compile(r"\bthe paper\b|\bpaper's\b|\bTables? [IVX]+\b|\b[Ee]qs?\. ?\(\d|\bFigs?\. ?\d|\(\d\d\)(?!\w)")
NAMED = re.compile(r"\b[A-Z]\w+( et al\.)? (19|20)\d\d\b")


def nameless(text: str) -> bool:
    """Whether `text` refers to a part of a publication that it does not name."""
    return bool(REFERENCE.search(text)) and not NAMED.search(text)


def literals(path: Path) -> Iterator[tuple[int, str]]:
    """Every text of a module that is no docstring, with its line; what is inserted stands as {}."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    passed = set()
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    for node in ast.walk(tree):
        if isinstance(node, documented) and node.body and isinstance(node.body[0], ast.Expr):
            passed.add(id(node.body[0].value))
        if isinstance(node, ast.JoinedStr):
            passed |= {id(part) for part in node.values}
    for node in ast.walk(tree):
        if id(node) in passed:
            continue
        if isinstance(node, ast.JoinedStr):
            yield node.lineno, "".join(str(part.value) if isinstance(part, ast.Constant) else "{}" for part in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.lineno, node.value


@pytest.mark.slow
def test_no_message_speaks_of_a_paper_without_its_name() -> None:
    wrong = [f"{path.relative_to(REPO)}:{line}: {text}" for path in FILES for line, text in literals(path) if nameless(text)]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("what", [*STAGES, "batch", "model", "log"])
def test_no_schema_speaks_of_a_paper_without_its_name(what: str) -> None:
    texts = re.findall(r'"description": "((?:[^"\\]|\\.)*)"', json.dumps(schema_of(what), ensure_ascii=False))
    assert not [text for text in texts if nameless(text)]


@pytest.mark.parametrize(("text", "expected"), [
    ("Table V of the paper", True), ("the observer, eq. (20)", True), ("Kostić et al. 2004, Table V", False), ("two tables", False),
    ("indirect, (29)", True), ("Observer of Schafer 2011, eq. (15)", False)])
def test_what_counts_as_nameless(text: str, expected: bool) -> None:
    assert nameless(text) is expected
