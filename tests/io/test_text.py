"""Small texts that a user names are read from regular files only: no pipe hangs, no device fills the memory."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from pipelines.errors import InputRejected, UsageError
from pipelines.io.robot_files import load_robot, robot_sources
from pipelines.io.sandbox import read_small_text


def test_a_text_is_read(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_bytes("ä = 1\r\nb = 2\n".encode())
    assert read_small_text(tmp_path / "a.toml") == "ä = 1\nb = 2\n"
    (tmp_path / "empty").write_bytes(b"")
    assert read_small_text(tmp_path / "empty") == ""


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


@pytest.mark.parametrize("text", ["a = 1" + "0" * 400, "a = 1" + "0" * 5000, 'a = 0.0\nname = "x\\u0000y"'])
def test_hostile_numbers_and_texts_of_a_robot_are_usage_errors(tmp_path: Path, text: str) -> None:
    """C01, C02: integers that no float can hold, NUL in a name."""
    (tmp_path / "r.toml").write_text('name = "r"\ngravity = [0, 0, 0]\n[kinematics]\nconvention = "dh"\n[[joint]]\n'
                                     f'name = "j"\nalpha = 0.0\nd = 0.0\noffset = 0.0\n{text}\n'.replace(
                                         'name = "j"\n', "" if "u0000" in text else 'name = "j"\n'))
    with pytest.raises(UsageError, match="RRID-C0[12]"):
        load_robot(tmp_path / "r.toml")


def test_the_files_of_a_robot_are_known(tmp_path: Path) -> None:
    """The description and the URDF it names are inputs: provenance wants their hashes."""
    (tmp_path / "r.toml").write_text('[kinematics]\nurdf = "arm.urdf"\n')
    assert robot_sources(tmp_path / "r.toml") == (tmp_path / "r.toml", tmp_path / "arm.urdf")
    assert [path.name for path in robot_sources("rrr")] == ["rrr.toml"]
