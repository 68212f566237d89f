"""What an error says: one printable line, and of what was mistyped the word that was meant."""

from __future__ import annotations

import pytest

from pipelines.errors import InputRejected, clean


def test_an_error_is_one_printable_line() -> None:
    """Whatever a log says of itself, a message stays one line without control characters."""
    problem = InputRejected("F01", "a\nb\x1b[31m", where="x\ty", remedy="do it")
    assert str(problem) == "RRID-F01 x y: a b[31m. Do it."
    assert len(clean("x" * 10_000)) == 400


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
