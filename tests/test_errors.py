"""What an error says: one printable line, and of what was mistyped the word that was meant."""

from __future__ import annotations

from pipelines.errors import InputRejected, clean


def test_an_error_is_one_printable_line() -> None:
    """Whatever a log says of itself, a message stays one line without control characters."""
    problem = InputRejected("F01", "a\nb\x1b[31m", where="x\ty", remedy="do it")
    assert str(problem) == "RRID-F01 x y: a b[31m. Do it."
    assert len(clean("x" * 10_000)) == 400
