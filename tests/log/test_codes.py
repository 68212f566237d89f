"""Every code that can reach a user is explained, and every explanation belongs to a code."""

from __future__ import annotations

import re
from pathlib import Path

from pipelines.log.codes import CODES, title_of

REPO = Path(__file__).resolve().parents[2]


def test_every_code_in_the_source_has_a_title_and_every_title_a_code() -> None:
    """A message says RRID-T05; the table says what that is."""
    sources = [path for folder in ("pipelines", "rrrid_cli") for path in (REPO / folder).rglob("*.py") if path.name != "codes.py"]
    used = {code for path in sources for code in re.findall(r'"(?:RRID-)?([FSTDCPXZ]\d\d)"', path.read_text(encoding="utf-8"))}
    assert used == set(CODES)
    assert title_of("RRID-T05") == "uneven sampling"
