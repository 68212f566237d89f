"""Every code that can reach a user is explained, and every explanation belongs to a code."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from pipelines.report.codes import codes, title_of

REPO = Path(__file__).resolve().parents[2]


def test_every_code_in_the_source_has_a_title_and_every_title_a_code() -> None:
    """A message says RRID-T05; the table says what that is."""
    sources = [path for folder in ("pipelines", "rrrid_cli") for path in (REPO / folder).rglob("*.py") if path.name != "codes.py"]
    used = {code for path in sources for code in re.findall(r'"(?:RRID-)?([FSTDCPXZ]\d\d)"', path.read_text(encoding="utf-8"))}
    assert used == set(codes())
    assert title_of("RRID-T05") == "uneven sampling"


def test_every_error_and_every_finding_says_what_to_do() -> None:
    """Code, place and remedy: no error is made without a remedy, no check other than "ok" without place and remedy."""
    order = ["code", "message", "where", "remedy"]  # as errors take them; a check has its level behind the code
    kinds, silent = {"RrridError", "UsageError", "InputRejected", "NothingMatched", "EnvironmentFault", "fail"}, []
    for path in (path for folder in ("pipelines", "rrrid_cli") for path in (REPO / folder).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call) or len(node.args) < 2:
                continue
            said, called = {keyword.arg for keyword in node.keywords}, ast.unparse(node.func)
            error = called.rpartition(".")[2] in kinds
            said |= set((order if error else [order[0], "level", *order[1:]])[:len(node.args)])
            level = node.args[1].value if isinstance(node.args[1], ast.Constant) else None
            wanted = {"remedy"} if error else {"where", "remedy"} if called == "Check.of" and level != "ok" else set()
            if wanted - said:
                silent.append(f"{path.relative_to(REPO)}:{node.lineno}")
    assert silent == []
