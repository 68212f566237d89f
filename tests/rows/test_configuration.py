"""Rows C: what is asked of a command. Nothing of what a wrong call names is run, written or overwritten."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipelines.io.files import open_log, write_log
from tests.healthy import good_log
from tests.io.logs import small_log
from tests.rows.commanded import Command

row = pytest.mark.row


@pytest.fixture(autouse=True)
def _a_log(tmp_path: Path) -> None:
    write_log(tmp_path / "logs/a.h5", small_log())


@pytest.mark.parametrize(("words", "says"), [
    (("convret", "logs"), "did you mean 'convert'"), (("convert", "logs", "--ot", "x"), "did you mean '--out'"),
    (("convert", "logs", "--set", "convert.tp=csv"), "there are: to"),
    (("convert", "logs", "--set", "convret.to=csv"), "did you mean 'convert'"),
    (("convert", "logs", "--config", "c.toml"), "did you mean 'to'")])
@row("C01")
def test_an_unknown_name(words: tuple[str, ...], says: str, command: Command, tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text('[convert]\ntoo = "csv"\n')
    command(*words).refused("C01", 2, says=says)


@pytest.mark.parametrize(("words", "says"), [
    (("reconstruct", "logs", "--bandwidth", "nan"), "positive"), (("reconstruct", "logs", "--bandwidth", "-1"), "positive"),
    (("reconstruct", "logs", "--order", "9"), "order"), (("estimate-bps", "logs", "--blocks", "0"), "block"),
    (("estimate-bps", "logs", "--cutoff-hz", "inf"), "cutoff"), (("convert", "logs", "--to", "xlsx"), "parquet"),
    (("extend", "logs", "--with", "cogging:9"), "1 to 3")])
@row("C02")
def test_a_value_out_of_its_bounds(words: tuple[str, ...], says: str, command: Command, tmp_path: Path) -> None:
    """The option, and what it takes."""
    write_log(tmp_path / "logs/a.h5", good_log())
    command(*words, "--no-report").refused("C02", 2, says=says)


BOMB = "a: &a [x, x]\n" + "".join(f"{c}: &{c} [*{b}, *{b}, *{b}, *{b}]\n" for b, c in zip("abcdefgh", "bcdefghi", strict=True))


@pytest.mark.parametrize("text", ["!!python/object/apply:os.system ['touch pwned']", BOMB, "[" * 100_000, 'a = """'])
@row("C03")
def test_what_is_not_toml_is_not_run(text: str, command: Command, tmp_path: Path) -> None:
    (tmp_path / "evil.yaml").write_text(text)
    command("convert", "logs", "--config", "evil.yaml").refused("C03", 2, "evil.yaml", "TOML")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["evil.yaml", "logs"]


@pytest.mark.parametrize("words", [("convert", "nowhere.h5"), ("convert", "logs", "--config", "nowhere.h5"),
                                   ("convert", "logs", "--robot", "nowhere.h5"), ("estimate-bps", "logs", "--model", "nowhere.h5"),
                                   ("estimate-bps", "logs", "--identify", "nowhere.h5"), ("import", "nowhere.h5")])
@row("C04")
def test_a_file_that_is_named_and_not_there(words: tuple[str, ...], command: Command) -> None:
    done = command(*words)
    assert (done.exit, done.error["code"]) == (2, "RRID-C04"), done.err
    assert "nowhere.h5" in done.error["where"] + done.error["message"]
    assert done.error["remedy"]


@row("C05")
def test_nothing_foreign_is_overwritten(command: Command, tmp_path: Path) -> None:
    """A folder with files of another, one inside the input, the input itself; rrrid's own is replaced."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/thesis.tex").write_text("all of it")
    command("convert", "logs", "--out", "mine").refused("C05", 2, "mine", "thesis.tex")
    command("convert", "logs", "--out", "logs/out").refused("C05", 2, "logs/out", "inside the input")
    command("convert", "logs/a.h5", "--out", "logs").refused("C05", 2, "logs")
    assert (tmp_path / "mine/thesis.tex").read_text() == "all of it"
    assert open_log(tmp_path / "logs/a.h5").log == small_log()
    for to in ("csv", "parquet"):
        assert command("convert", "logs", "--out", "out", "--to", to).exit == 0
    assert not (tmp_path / "out/csv").exists()
    (tmp_path / "out/notes.txt").write_text("mine")
    command("convert", "logs", "--out", "out").refused("C05", 2, "out", "notes.txt")


@row("C06")
def test_nothing_matches(command: Command, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    command("convert", "nope*.h5").refused("C06", 5, "nope*.h5", ".h5 or .parquet")
    command("convert", "empty").refused("C06", 5, "empty", ".h5 or .parquet")


@row("C07")
def test_strange_paths_work_or_are_refused(command: Command, tmp_path: Path) -> None:
    """Letters of any alphabet, blanks, a newline; 300 letters are no path. What is written has a plain name."""
    folder = tmp_path / "Prüf stand\n№ 1 $a_{ [/x]"
    write_log(folder / "ä ö.h5", small_log(name="µ \n x"))
    assert command("convert", folder).exit == 0
    (written,) = (tmp_path / "runs").rglob("*.parquet")
    allowed = set("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-/")
    assert set(written.relative_to(tmp_path).as_posix()) <= allowed
    for words in (("convert", "x" * 300), ("convert", "logs", "--robot", "x" * 300), ("convert", "logs", "--config", "x" * 300),
                  ("estimate-bps", "logs", "--model", "x" * 300), ("import", "x" * 300), ("design-excitation", "x" * 300)):
        done = command(*words)
        assert done.exit == 2, done.err
        assert done.error["where"]
        assert done.error["remedy"]
    assert command("convert", "logs", "--out", "x" * 300).exit in (2, 6)
