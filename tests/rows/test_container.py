"""Rows F: what a file is. Each through a command: exit code, code, place and remedy."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Callable
from pathlib import Path

import h5py
import pytest

from pipelines.io.files import write_log
from tests.cli.test_bad_files import (
    _attribute,
    _bytes,
    _flip_page,
    _flip_sample,
    _killed_writer,
    _manifest,
)
from tests.importers.good import RECIPE, good, lines, text
from tests.importers.test_matlab import mat5, mat73, signals
from tests.io.logs import small_log
from tests.io.test_hostile import _foreign_filter, _replace_q
from tests.rows.commanded import Command, Done

row = pytest.mark.row


def _filtered(path: Path) -> None:
    with h5py.File(path, "a") as file:
        _replace_q(file, _foreign_filter)


SPOILT: tuple[tuple[str, str, Callable[[Path], object], str], ...] = (
    ("F01", ".h5", _bytes(lambda data: b""), "empty file"),
    ("F02", ".h5", _bytes(lambda data: data[:len(data) // 2]), "truncated: "),
    ("F03", ".h5", _killed_writer, "h5clear -s"),
    ("F04", ".h5", _flip_sample, "checksum mismatch"), ("F04", ".parquet", _flip_page, "checksum mismatch"),
    ("F05", ".h5", _manifest, "sha256 differs from the manifest"),
    ("F06", ".h5", _bytes(lambda data: b"t,q\n1,2\n"), ".csv, .txt, .mat and .npy"),
    ("F07", ".parquet", _bytes(lambda data: data[:-10]), "no footer"),
    ("F10", ".h5", _filtered, "hdf5plugin"),
    ("F11", ".h5", _attribute("format_version", 2), "understands version 1"),
)


@pytest.mark.parametrize(("code", "ending", "spoil", "says"), [
    pytest.param(*case, marks=row(case[0]), id=case[0] + case[1]) for case in SPOILT])
def test_a_spoilt_log_is_refused(code: str, ending: str, spoil: Callable[[Path], object], says: str, command: Command,
                                 tmp_path: Path) -> None:
    """Exit 3; the file is named, of a damaged chunk the data set too; nothing is written."""
    write_log(tmp_path / f"a{ending}", small_log())
    spoil(tmp_path / f"a{ending}")
    command("convert", f"a{ending}", "--out", "out").refused(code, 3, f"a{ending}", says)
    if (code, ending) == ("F04", ".h5"):
        command("convert", "a.h5", "--out", "out").refused(code, 3, "/signals/q")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("share", [0.01, 0.1, 0.5, 0.9, 0.999])
@row("F02")
def test_any_prefix_of_a_log_is_refused(share: float, command: Command, tmp_path: Path) -> None:
    """How many bytes are there, of how many, and that the file be copied again; of a few bytes, that they are no log."""
    write_log(tmp_path / "a.h5", small_log())
    data = (tmp_path / "a.h5").read_bytes()
    kept = int(share * len(data))
    (tmp_path / "a.h5").write_bytes(data[:kept])
    done = command("convert", "a.h5", "--out", "out")
    done.refused("F02", 3, "a.h5", f"truncated: {kept} of {len(data)} bytes")
    assert done.error["remedy"].startswith("copy")


@row("F05")
def test_a_log_that_nothing_vouches_for_is_read_with_one_warning(command: Command, tmp_path: Path) -> None:
    write_log(tmp_path / "a.h5", small_log())
    with h5py.File(tmp_path / "a.h5", "a") as file:
        del file.attrs["digest"]
    done = command("convert", "a.h5", "--out", "out", as_json=False)
    assert done.exit == 0
    assert (done.out + done.err).count("RRID-F05 a.h5: no integrity data") == 1


@row("F06")
def test_a_log_is_read_by_its_content(command: Command, tmp_path: Path) -> None:
    write_log(tmp_path / "a.parquet", small_log())
    (tmp_path / "a.parquet").rename(tmp_path / "a.h5")
    done = command("convert", "a.h5", "--out", "out", as_json=False)
    assert done.exit == 0
    assert "RRID-F06 a.h5: named '.h5', but its content is parquet" in done.out + done.err


@pytest.mark.parametrize("version", ["5", "5z", "7.3"])
@row("F08")
def test_a_truncated_mat_file_has_one_message(command: Command, tmp_path: Path, version: str) -> None:
    (tmp_path / "data").mkdir()
    path = tmp_path / "data/run.mat"
    if version == "7.3":
        mat73(path)
    else:
        mat5(path, signals(), do_compression=version == "5z")
    path.write_bytes(path.read_bytes()[:path.stat().st_size // 2])
    (tmp_path / "r.toml").write_text(RECIPE.replace("*.csv", "*.mat"))
    command("import", "r.toml", "--source", "data", "--out", "out").refused("F08", 3, "run.mat", "truncated or damaged MAT file")


def _text(command: Command, tmp_path: Path, content: str | bytes, *words: str) -> Done:
    (tmp_path / "data").mkdir(exist_ok=True)
    (tmp_path / "data/run.csv").write_bytes(content.encode() if isinstance(content, str) else content)
    (tmp_path / "r.toml").write_text(RECIPE)
    return command("import", "r.toml", "--source", "data", "--out", "out", "--no-report", *words)


@row("F09")
def test_a_torn_recording_is_kept_up_to_the_damage(command: Command, tmp_path: Path) -> None:
    """Cut off in its last line: the line is named; --strict and too much damage are exit 3."""
    cut = text(good())[:-50]
    done = _text(command, tmp_path, cut)
    (check,) = done.told("F09")
    assert (done.exit, check["level"]) == (0, "repair")
    assert "run.csv" in check["where"]
    assert f"line {cut.count(chr(10)) + 1}" in check["message"]
    _text(command, tmp_path, cut, "--strict").refused("F09", 3, "run.csv")
    half = [*lines()[:9], *(line[:len(line) // 2] for line in lines()[9:40]), *lines()[40:]]
    _text(command, tmp_path, "\n".join(half)).refused("F09", 3, "run.csv", "line 10")


@row("F16")
def test_a_text_file_of_another_dialect(command: Command, tmp_path: Path) -> None:
    """Semicolons and decimal commas, UTF-16, a byte order mark are told; a NUL and a spreadsheet's error are refused by line."""
    plain = text(good())
    for content, said in ((plain.replace(",", ";").replace(".", ","), "semicolon, decimal comma"),
                          (plain.encode("utf-16"), "utf-16"), (b"\xef\xbb\xbf" + plain.encode(), "utf-8-sig")):
        done = _text(command, tmp_path, content)
        checks = done.told("F16")
        assert (done.exit, [c["level"] for c in checks]) == (0, ["warn"])
        assert said in checks[0]["message"]
    rows = lines()
    for at, cell in ((20, "\0"), (9, "#REF!")):
        spoilt = [*rows[:at], cell + rows[at][rows[at].index(","):], *rows[at + 1:]]
        _text(command, tmp_path, "\n".join(spoilt)).refused("F16", 3, "run.csv", f"line {at + 1}")


@row("F12")
def test_what_is_no_regular_file_does_not_hang(command: Command, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.h5")
    (tmp_path / "folder.h5").mkdir()
    began = time.monotonic()
    for words in (("convert", "pipe.h5"), ("convert", "/dev/zero"), ("import", "pipe.h5")):
        command(*words).refused("F12", 3, words[-1], "not a regular file")
    assert command("convert", "folder.h5").exit == 5  # a folder of logs, and there is none in it
    assert time.monotonic() - began < 10


@row("F13")
def test_a_file_that_may_not_be_read_is_the_environment(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The superuser, who may all, is told that he may not."""
    write_log(tmp_path / "a.h5", small_log())
    may = os.access
    monkeypatch.setattr(os, "access", lambda path, mode, **more: not str(path).endswith("a.h5") and may(path, mode, **more))
    command("convert", "a.h5").refused("F13", 6, "a.h5", "permission denied")


@row("F14")
def test_a_file_that_changes_meanwhile(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its hash is taken before and after; nothing is written, so nothing is kept of it."""
    from dataclasses import replace

    from pipelines import convert

    write_log(tmp_path / "a.h5", small_log())

    def meddle(inputs: object, settings: object) -> object:
        write_log(tmp_path / "a.h5", small_log(name="another"))
        return compute(inputs, settings)  # type: ignore[arg-type]

    compute = convert.STAGE.compute
    monkeypatch.setattr(convert, "STAGE", replace(convert.STAGE, compute=meddle))  # type: ignore[arg-type]
    command("convert", "a.h5", "--out", "out").refused("F14", 3, "a.h5", "modified")
    assert not (tmp_path / "out").exists()


@row("F15")
def test_a_file_that_is_being_written_is_in_use(command: Command, tmp_path: Path) -> None:
    write_log(tmp_path / "a.h5", small_log())
    began = time.monotonic()
    with (tmp_path / "a.h5").open("r+b") as writer:
        fcntl.flock(writer, fcntl.LOCK_EX)
        command("convert", "a.h5").refused("F15", 6, "a.h5", "in use by another process")
    assert time.monotonic() - began < 10


def test_the_good_log_is_no_row(command: Command, tmp_path: Path) -> None:
    """What every case here spoils is taken as it is."""
    write_log(tmp_path / "a.h5", small_log())
    assert command("convert", "a.h5", "--out", "converted").exit == 0
    assert _text(command, tmp_path, text(good())).exit == 0
