"""Values of a recipe that no recording can have are answered with C01 or C02, never with a traceback."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipelines.errors import InputRejected, UsageError
from pipelines.importers.recipe import parse_recipe
from tests.importers.good import good, run, text, write

HEAD = """
[robot]
use = "rrr"
[log]
match = "*.csv"
experiment = "free"
[signals]
q = { columns = "q_{j}", unit = "rad" }
tau = { columns = "tau_{j}", unit = "N m" }
[time]
rate = 1000.0
"""


@pytest.mark.parametrize(("line", "words"), [
    ('delimiter = ",,"', "format.delimiter"), ('delimiter = "\\n"', "format.delimiter"), ('delimiter = "1"', "format.delimiter"),
    ('decimal = "x"', "format.decimal"), ('encoding = "utf-8\\u0000"', "format.encoding"),
    ('encoding = "klingon"', "format.encoding"),
    ('encoding = "base64"', "format.encoding"), ('comment = "\\n"', "format.comment"), ('comment = ""', "format.comment"),
])
def test_a_format_that_no_text_can_have(line: str, words: str) -> None:
    with pytest.raises(UsageError, match=f"RRID-C02 .*{words}"):
        parse_recipe(f"{HEAD}[format]\n{line}\n")


@pytest.mark.parametrize("line", ['delimiter = ";"', 'delimiter = ""', 'delimiter = "\\t"', 'decimal = ","', 'encoding = "latin-1"',
                                  'comment = "#"', "header = true"])
def test_a_format_that_texts_have(line: str) -> None:
    parse_recipe(f"{HEAD}[format]\n{line}\n")


@pytest.mark.parametrize("digits", [400, 5000])
def test_integers_without_end(digits: int) -> None:
    """No float holds the one, and Python does not even read the other."""
    with pytest.raises(UsageError, match="RRID-C0[12]"):
        parse_recipe(HEAD.replace("1000.0", "1" + "0" * digits))


@pytest.mark.parametrize(("before", "after", "words"), [
    ('experiment = "free"', 'experiment = "friction"\njoint = 9', "joint is 9, outside 1 … 3"),
    ('experiment = "free"', 'experiment = "hold"\nposture = [0.1, 0.2]', "posture has 2 values for 3 joints"),
    ("[time]", '[controller]\nlaw = "unknown"\noutput_limit = [1.0, 2.0]\n[time]', "output_limit has shape"),
])
def test_numbers_of_other_joints(tmp_path: Path, before: str, after: str, words: str) -> None:
    """A joint, a posture or limits that the robot does not have are refused before the doctor judges the log."""
    folder = write(tmp_path / "data", text(good())).parent
    with pytest.raises(InputRejected, match=f"RRID-S20 .*{words}"):
        run(folder, HEAD.replace(before, after))
