"""A pytest plugin that prints which tests bear which row of the table of bad inputs, as one line of JSON.

    pytest --collect-only -p tests.rows.collected FILES
"""

from __future__ import annotations

import json

import pytest

__all__ = ["BEGINS", "rows_of"]

BEGINS = "rows: "


def pytest_collection_finish(session: pytest.Session) -> None:
    print(BEGINS + json.dumps(rows_of(session)))


def rows_of(session: pytest.Session) -> dict[str, list[str]]:
    """row -> tests, after slow ones were left out: a row whose only test is a campaign, is skipped, or may fail, is not tested."""
    rows: dict[str, list[str]] = {}
    for item in session.items:
        if any(item.iter_markers("skip")) or any(item.iter_markers("xfail")):
            continue
        for mark in item.iter_markers("row"):
            for code in mark.args:
                rows.setdefault(code, []).append(item.nodeid)
    return rows
