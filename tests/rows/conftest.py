"""The command, for every test of a row."""

from __future__ import annotations

from tests.rows.commanded import command

__all__ = ["command"]
