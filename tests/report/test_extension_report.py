"""What the report of an extension says of its figures."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from pipelines.report.diagnosis_report import _extension_now


@pytest.mark.parametrize(("origins", "said"), [
    (("residual",), "Now: fitted without what it is extended by."),
    (("residual", "base parameters"), "Now: by the base parameters of before, without payload at the tip,"), ((), "")])
def test_whose_error_is_now_is_told(origins: tuple[str, ...], said: str) -> None:
    """Base parameters that are fitted to later logs hold a load: the error that it takes away is counted from those of before."""
    names = {"residual": "cogging", "base parameters": "payload"}
    there: Any = SimpleNamespace(findings=tuple(SimpleNamespace(cause=names[one], joint=None, origin=one) for one in origins))
    assert _extension_now(there).startswith(said) if said else not _extension_now(there)
