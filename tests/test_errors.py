"""Every error says what to do: the code of all of rrrid is asked, not only the paths that tests happen to run."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from pipelines.errors import InputRejected, clean, did_you_mean

REPO = Path(__file__).resolve().parents[1]
KINDS = {"InputRejected", "UsageError", "EnvironmentFault", "NothingMatched"}
MODULES = [path.relative_to(REPO).as_posix() for folder in ("pipelines", "rrrid_cli")
           for path in sorted((REPO / folder).rglob("*.py"))]


def _silent(text: str) -> list[int]:
    """Lines of `text` that make an error without a remedy. `fail` is what two readers call the kind they were given."""
    calls = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call)]
    errors = [call for call in calls if getattr(call.func, "id", getattr(call.func, "attr", "")) in KINDS | {"fail"}]
    return [call.lineno for call in errors if "remedy" not in {keyword.arg for keyword in call.keywords}]


@pytest.mark.parametrize("module", MODULES)
def test_every_error_says_what_to_do(module: str) -> None:
    """Rule 11: refuse early, say what, where, and what to do."""
    assert _silent((REPO / module).read_text(encoding="utf-8")) == []


def test_a_silent_error_is_seen() -> None:
    """The test above can fail."""
    assert _silent('raise InputRejected("F01", "empty file", where="a")') == [1]
    assert _silent('raise errors.UsageError("C01", "x", remedy="y")') == []


def test_an_error_is_one_printable_line() -> None:
    """Whatever a log says of itself, a message stays one line without control characters."""
    problem = InputRejected("F01", "a\nb\x1b[31m", where="x\ty", remedy="do it")
    assert str(problem) == "RRID-F01 x y: a b[31m. Do it."
    assert len(clean("x" * 10_000)) == 400


@pytest.mark.parametrize(("word", "most", "said"), [
    ("--twins", 1, ""),  # only the dashes, which every option has, make it like --joints
    ("--quiet", 1, ""), ("--modle", 1, ", did you mean '--model'?"), ("-models", 1, ", did you mean '--model'?"),
    ("--mosel", 2, ", did you mean '--model' or '--most'?"), ("--mode", 1, ", did you mean '--model'?"),
])
def test_only_what_is_near_is_suggested(word: str, most: int, said: str) -> None:
    assert did_you_mean(word, ("--joints", "--model", "--most", "--out"), most) == said


@pytest.mark.parametrize(("message", "remedy", "said"), [
    ("no '--ot', did you mean '--out'?", "see 'rrrid --help'", "no '--ot', did you mean '--out'? See 'rrrid --help'."),
    ("rate is 0.001 Hz: a period?", "", "rate is 0.001 Hz: a period?"),
    ("x.", "h5 or parquet", "x. h5 or parquet."),
    ("x", "rrrid import makes one.", "x. rrrid import makes one."),
    ("x", "--out chooses another", "x. --out chooses another."),
    ("x", "trust_units vouches", "x. trust_units vouches."),
])
def test_one_mark_ends_a_sentence_and_names_stay_as_they_are(message: str, remedy: str, said: str) -> None:
    """No full stop behind a question mark; what is typed (options, values, keys) gets no capital."""
    assert str(InputRejected("F01", message, remedy=remedy)) == f"RRID-F01 {said}"
