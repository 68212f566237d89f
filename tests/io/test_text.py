"""Small texts that a user names are read from regular files only: no pipe hangs, no device fills the memory."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from pipelines.errors import InputRejected, UsageError
from pipelines.io.sandbox import read_small_text


def test_what_is_no_text_is_refused(tmp_path: Path) -> None:
    """F12: FIFO, device, folder; C02: too long, not UTF-8; C04: not there. None of them hangs."""
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero"), tmp_path):
        with pytest.raises(InputRejected, match="RRID-F12 .*not a regular file.*TOML"):
            read_small_text(path)
    (tmp_path / "long").write_text("x" * 101)
    (tmp_path / "binary").write_bytes(b"a = \xff")
    for name, words in (("long", "longer than the 100 bytes"), ("binary", "not a text in UTF-8: byte 4 is 0xff")):
        with pytest.raises(UsageError, match=f"RRID-C02 .*{words}"):
            read_small_text(tmp_path / name, 100)
    with pytest.raises(UsageError, match="RRID-C04"):
        read_small_text(tmp_path / "nowhere")
