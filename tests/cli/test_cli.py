"""The command line as a user meets it: one line for every error, the exit code promised, nothing else on stdout."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from pipelines.effects import all_effects
from pipelines.io.files import open_log, write_log
from tests.cli.commands import REPO, rrrid
from tests.io.logs import small_log
from tests.rows.commanded import Command


def test_a_command_leaves_a_folder_and_says_where(logs: Path) -> None:
    """The default folder is runs/ROBOT/FOLDER/COMMAND, and the last line names the report."""
    done = rrrid("convert", "logs", cwd=logs)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines()[-1] == "→ runs/rrr-tue/logs/convert/report.html"
    folder = logs / "runs/rrr-tue/logs/convert"
    assert open_log(folder / "logs/a.parquet").log == small_log()


def test_json_is_alone_on_standard_output(logs: Path) -> None:
    """--json: stdout is result.json's object and nothing else; words go to stderr."""
    done = rrrid("convert", "logs", "--json", "--out", "out", cwd=logs)
    assert json.loads(done.stdout) == json.loads((logs / "out/result.json").read_text())
    assert "converted" in done.stderr


@pytest.mark.parametrize(("words", "code", "exit_code"), [
    (("convert", "nowhere"), "RRID-C04", 2),
    (("convert", "empty"), "RRID-C06", 5),
    (("convert", "logs/text.h5"), "RRID-F06", 3),
    (("convert", "logs/a.h5", "--set", "convert.tp=csv"), "RRID-C01", 2),
    (("convert", "logs/a.h5", "--to", "xlsx"), "RRID-C02", 2),
    (("convert", "logs/a.h5", "--format", "zip"), "RRID-C02", 2),
    (("convert", "logs/a.h5", "--robot", "nobody"), "RRID-C04", 2),
    (("estimate-bps", "logs/a.h5", "--cutoff-hz", "fast"), "RRID-C02", 2),
    (("convert", "logs/a.h5", "--config", "no.toml"), "RRID-C04", 2),
    (("convert", "logs/a.h5", "--config", "evil.yaml"), "RRID-C03", 2),
    (("convert", "logs", "--out", "logs/out"), "RRID-C05", 2),
    (("convert", "own/logs/a.h5", "--out", "own", "--force"), "RRID-C05", 2),
    (("convert", "logs/a.h5", "--robot", "pipe"), "RRID-F12", 3),
    (("convert", "logs/a.h5", "--set", f"convert.to=1{'0' * 5000}"), "RRID-C02", 2),
    (("run", "logs", "--set", "inspect.bogus=1"), "RRID-C01", 2),
    (("run", "logs", "--set", "inspect.trust_units=3"), "RRID-C02", 2),
    (("run", "logs", "--set", "diagnose.model=m.json"), "RRID-C04", 2),
    (("convert", "logs/a.h5", "--joints", "1,x"), "RRID-C02", 2),
    (("convert", "logs/a.h5", "--joints", "1,4"), "RRID-C02", 2),
    (("import", "r.toml"), "RRID-C02", 2),
    (("import", "no-such-recipe"), "RRID-C04", 2),
])
def test_every_error_is_one_line_with_code_and_remedy(logs: Path, words: tuple[str, ...], code: str, exit_code: int,
                                                      command: Command) -> None:
    """No traceback reaches a user; with --json the same error stands on stdout as an object."""
    (logs / "empty").mkdir()
    (logs / "logs/text.h5").write_text("t,q\n1,2\n")
    (logs / "evil.yaml").write_text("!!python/object/apply:os.system ['touch pwned']")
    (logs / "r.toml").write_text('[format]\ndelimiter = ",,"\n')
    write_log(logs / "own/logs/a.h5", small_log())
    (logs / "own/provenance.json").write_text('{"tool": "rrrid", "outputs": {"result.json": "0"}}')
    os.mkfifo(logs / "pipe")
    command(*words).refused(code.removeprefix("RRID-"), exit_code)
    assert not (logs / "pwned").exists()
    assert open_log(logs / "logs/a.h5").log == open_log(logs / "own/logs/a.h5").log == small_log()


@pytest.mark.parametrize(("words", "said"), [
    (("convret",), "RRID-C01 rrrid: no such command 'convret', did you mean 'convert'? See 'rrrid --help'."),
    (("--vers",), "RRID-C01 rrrid: no such option '--vers', did you mean '--version'? See 'rrrid --help'."),
    (("convert", "logs", "--ot", "x"),
     "RRID-C01 rrrid convert: no such option '--ot', did you mean '--out'? See 'rrrid convert --help'."),
    (("convert",), "RRID-C02 rrrid convert: missing argument 'LOGS'. See 'rrrid convert --help'."),
    (("reconstruct", "logs", "--order", "x"), "RRID-C02 --order: 'x' is no whole number. Give a whole number, such as 4."),
    (("diagnose", "logs", "--exclude", "coging"),
     "RRID-C01 --exclude: 'coging' is not a cause, did you mean 'cogging'? 'rrrid diagnose --help' lists all causes."),
    (("diagnose", "logs", "--exclude", "cogging:2"),
     "RRID-C02 --exclude: 'cogging:2': a cause is left out as a whole, at every joint. Write cogging."),
    (("convert", "logs", "-q", "-v"), "RRID-C02 -q, -v: "),
    (("diagnose", "logs", "--most", "3"), "RRID-C01 rrrid diagnose: no such option '--most', it is --max-causes now. See "),
])
def test_wrong_usage_is_one_line_and_exit_2(logs: Path, words: tuple[str, ...], said: str) -> None:
    """A misspelt command or option, a missing argument or a wrong value is said as every other error is."""
    for json_too in ((), ("--json",)):
        done = rrrid(*words, *json_too, cwd=logs)
        assert done.returncode == 2
        assert done.stderr.startswith(f"rrrid: {said}")
        assert done.stderr.count("\n") == 1
        assert not json_too or said.startswith(json.loads(done.stdout)["error"]["code"])


def test_settings_come_from_file_then_set_then_options(logs: Path) -> None:
    """The last word has the command line; tables of other stages in the same file are left alone."""
    (logs / "c.toml").write_text('[convert]\nto = "csv"\n[inspect]\n')
    assert (logs / "x/csv").is_dir() is False
    rrrid("convert", "logs", "--config", "c.toml", "--out", "x", cwd=logs)
    assert (logs / "x/csv/a.csv").is_file()
    rrrid("convert", "logs", "--config", "c.toml", "--set", "convert.to=h5", "--out", "y", cwd=logs)
    assert (logs / "y/logs/a.h5").is_file()
    rrrid("convert", "logs", "--set", "convert.to=h5", "--to", "parquet", "--out", "z", cwd=logs)
    assert (logs / "z/logs/a.parquet").is_file()


def test_format_decides_where_to_does_not(logs: Path) -> None:
    """convert --format h5 writes HDF5 of HDF5; --to has the last word, --set the one before."""
    for options, file in ((("--format", "h5"), "logs/a.h5"), (("--format", "h5", "--to", "parquet"), "logs/a.parquet"),
                          (("--format", "parquet", "--set", "convert.to=csv"), "csv/a.csv"), ((), "logs/a.parquet")):
        done = rrrid("convert", "logs", "--out", "out", "--no-report", *options, cwd=logs)
        assert done.returncode == 0, done.stderr
        assert (logs / "out" / file).is_file(), options


def test_an_estimate_loads_only_what_it_uses(tmp_path: Path) -> None:
    """Neither URDF, tables nor plots: each costs 100 to 1000 ms.

    typer reads its options by pydantic; the verdict is a sentence, and sentences are jinja2 templates.
    """
    unused = {"xml", "scipy", "pandas", "matplotlib", "pyarrow", "rich"}
    code = ("import sys, rrrid_cli.main as main\ntry:\n    main.entry()\nexcept SystemExit:\n    pass\n"
            f"print(sorted({unused} & set(sys.modules)))")
    log = REPO / "sample_logs/rrr-closed-form/excitation-1.h5"
    words = ("estimate-bps", log, "--no-report", "--quiet", "--cutoff-hz", "20", "--out", tmp_path / "out")
    done = subprocess.run([sys.executable, "-c", code, *map(str, words)], capture_output=True, text=True, cwd=REPO, check=False)
    assert (done.stdout, done.stderr) == ("[]\n", "")
    assert (tmp_path / "out/model.json").is_file()


def test_help_is_plain(tmp_path: Path) -> None:
    """Every command explains itself and the shared options."""
    top = rrrid("--help", cwd=tmp_path).stdout
    for name in ("run", "inspect", "import", "convert"):
        assert f"  {name} " in top
        assert "--out" in rrrid(name, "--help", cwd=tmp_path).stdout


@pytest.mark.parametrize("command", ["extend", "demo"])
def test_help_names_every_cause(command: str, tmp_path: Path) -> None:
    """Where a cause is asked for, all of them can be read, each with its title."""
    lines = {" ".join(line.split()) for line in rrrid(command, "--help", cwd=tmp_path).stdout.splitlines()}
    assert {f"{effect.name} {effect.words.title}" for effect in all_effects()} <= lines


def test_a_pattern_that_the_shell_left_is_expanded(logs: Path) -> None:
    """C06: a pattern that matches nothing is exit 5, not a missing file; one that matches is its matches."""
    done = rrrid("inspect", "nope*.h5", cwd=logs)
    assert (done.returncode, done.stderr.split(":")[1]) == (5, " RRID-C06 nope*.h5")
    write_log(logs / "logs/b.h5", small_log())
    write_log(logs / "logs/[c].h5", small_log())
    done = rrrid("convert", "logs/[a-b].h5", "logs/[c].h5", "--json", cwd=logs)
    assert [log["source"] for log in json.loads(done.stdout)["logs"]] == ["a.h5", "b.h5", "[c].h5"]
    assert (logs / "runs/rrr-tue/logs/convert").is_dir()


def test_all_bad_files_are_named(logs: Path) -> None:
    """One bad file of a folder is exit 3, and the others are named with it: nobody mends them one run at a time."""
    for name in ("b", "c"):
        (logs / f"logs/{name}.h5").write_text("t,q\n")
    (logs / "logs/d.h5").touch()
    done = rrrid("convert", "logs", "--out", "out", cwd=logs)
    assert done.returncode == 3
    assert done.stderr.startswith("rrrid: RRID-F06 logs/b.h5: neither HDF5 nor Parquet; "
                                  "2 more cannot be used: c.h5 (RRID-F06), d.h5 (RRID-F01). ")
    assert not (logs / "out").exists()


def test_schema_describes_the_shipped_model(tmp_path: Path, samples: Path) -> None:
    """`rrrid schema model` prints a JSON schema that the full example fulfils."""
    import jsonschema

    schema = json.loads(rrrid("schema", "model", cwd=tmp_path).stdout)
    jsonschema.validate(json.loads((samples / "models/rrr.json").read_text()), schema)


def test_a_log_of_another_program_is_converted(tmp_path: Path) -> None:
    """A log written by h5py alone, in another layout, without digest or checksums, becomes a full one, with one warning."""
    log = small_log(controller=None)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for key in ("name", "experiment", "role", "origin", "robot_name", "sample_time"):
            file.attrs[key] = getattr(log, key)
        file.attrs["format"], file.attrs["format_version"] = "rrrid-log", 1
        file["robot"] = log.robot_text
        for name, signal in log.signals.items():
            file[f"signals/{name}"] = np.asarray(signal.values, dtype="f8")
            file[f"signals/{name}"].attrs["units"] = signal.units
            file[f"signals/{name}"].attrs["long_name"] = signal.long_name
    done = rrrid("convert", "a.h5", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stdout.count("RRID-F05") == 1
    assert np.array_equal(open_log(tmp_path / "out/logs/a.parquet").log.q, log.q)
