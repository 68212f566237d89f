"""A log is the same log in either container, and the files are what the format says."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest

from pipelines.errors import InputRejected
from pipelines.io.files import find_logs, open_log, write_log
from pipelines.io.log import Controller, Derived, Signal
from tests.io.logs import random_log, small_log
from tests.seeds import seeds

BOTH = pytest.mark.parametrize("ending", [".h5", ".parquet"])


@pytest.mark.parametrize("seed", seeds(40, 10))
def test_there_and_back_is_bit_for_bit(tmp_path: Path, seed: int) -> None:
    """HDF5 to Parquet and back keeps every sample's bits and every attribute, and the same bytes of HDF5 come out."""
    log = random_log(np.random.default_rng(seed))
    first, second, third = tmp_path / "a.h5", tmp_path / "b.parquet", tmp_path / "c.h5"
    write_log(first, log)
    write_log(second, open_log(first).log)
    write_log(third, open_log(second).log)
    assert open_log(third).log == log
    assert open_log(second).log == log
    assert first.read_bytes() == third.read_bytes()


def test_equality_notices_one_bit_and_one_attribute() -> None:
    """Equality is strict enough for the test above to be able to fail."""
    log = small_log()
    q = log.q.copy()
    q[7, 1] = np.nextafter(q[7, 1], 9.0)
    assert replace(log, signals={**log.signals, "q": Signal(q, "rad", log.signals["q"].long_name)}) != log
    assert replace(log, torque=None) != log
    assert replace(log, controller=replace(log.controller, delay=0)) != log
    assert replace(log, controller=replace(log.controller, kp=np.array([1500, 1100, 140.0000001]))) != log


def test_independent_checker_accepts_what_is_written(tmp_path: Path, shared: Path) -> None:
    """The strict checker, written apart from the project, finds no fault."""
    write_log(tmp_path / "small.h5", small_log())
    done = subprocess.run([sys.executable, shared / "tools/check_log.py", tmp_path], capture_output=True, text=True, check=False)
    assert done.stdout == "1 checked, 0 faulty\n"
    assert done.returncode == 0


@BOTH
def test_a_newer_version_is_refused_by_name(tmp_path: Path, ending: str) -> None:
    """F11: the message names the version this program understands."""
    path = tmp_path / f"a{ending}"
    write_log(path, small_log())
    if ending == ".h5":
        with h5py.File(path, "a") as file:
            file.attrs["format_version"] = 2
    else:
        table = pq.read_table(path)
        text = table.schema.metadata[b"rrrid"].replace(b'"format_version":1', b'"format_version":2')
        pq.write_table(table.replace_schema_metadata({b"rrrid": text}), path)
    with pytest.raises(InputRejected, match=r"RRID-F11 .*format_version 2; this program understands version 1"):
        open_log(path)


def test_matlab_style_attributes_are_understood(tmp_path: Path) -> None:
    """Programs that know only doubles and fixed-length bytes write the same log."""
    path, log = tmp_path / "a.h5", small_log(experiment="friction", joint=2)
    write_log(path, log)
    with h5py.File(path, "a") as file:
        del file.attrs["digest"]
        file.attrs["joint"] = 2.0
        file.attrs["role"] = np.bytes_("identify")
        file["controller"].attrs["delay"] = np.float32(1.0)
    assert open_log(path).log == log


@BOTH
@pytest.mark.parametrize(("change", "code", "words"), [
    ({"joint": 4, "experiment": "friction"}, "S20", "outside 1"),
    ({"recorded": "yesterday"}, "S20", "ISO 8601"),
    ({"role": "bogus"}, "S20", "identify, validate, reference"),
    ({"name": " "}, "S20", "not empty"),
    ({"robot_name": "\ud800"}, "S20", "UTF-8"),
    ({"sample_time": float("nan")}, "S20", "positive number of seconds"),
    ({"posture": np.array([0.0, np.nan, 0.0])}, "S20", "finite"),
    ({"controller": Controller("bogus")}, "S20", "law"),
    ({"controller": Controller("pd", kp=[1, np.nan, 1], kd=[1, 1, 1])}, "S20", "kp.*finite"),
    ({"derived": Derived("import", "no json", "0", "2024-01-01T00:00:00Z")}, "S20", "settings.*JSON"),
    ({"origin": "planned"}, "S20", "references only, but there is q, tau"),
])
def test_a_writer_refuses_what_is_not_a_log(tmp_path: Path, ending: str, change: dict[str, object], code: str, words: str) -> None:
    """Nothing reaches the disk that a reader would have to refuse."""
    with pytest.raises(InputRejected, match=f"RRID-{code} .*{words}"):
        write_log(tmp_path / f"a{ending}", small_log(**change))
    assert list(tmp_path.iterdir()) == []


@BOTH
@pytest.mark.parametrize(("signal", "code", "words"), [
    (Signal(small_log().tau, "furlong", "x"), "S05", "'furlong', the format wants 'N m'"),
    (Signal(small_log().tau, "N m", "\ud800"), "S20", "UTF-8"),
])
def test_a_writer_refuses_other_units(tmp_path: Path, ending: str, signal: Signal, code: str, words: str) -> None:
    """Everything inside a log is SI: a writer converts nothing, and writes nothing else."""
    log = small_log()
    with pytest.raises(InputRejected, match=f"RRID-{code} .*{words}"):
        write_log(tmp_path / f"a{ending}", replace(log, signals={**log.signals, "tau": signal}))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("key", "value"), [("sample_time", 10**400), ("name", "\ud800")])
def test_numbers_and_texts_beyond_all_bounds_in_parquet(tmp_path: Path, key: str, value: object) -> None:
    """S20, not a traceback: JSON holds integers and texts that nothing else can."""
    write_log(tmp_path / "a.parquet", small_log())
    table = pq.read_table(tmp_path / "a.parquet")
    about = json.loads(table.schema.metadata[b"rrrid"]) | {key: value}
    pq.write_table(table.replace_schema_metadata({b"rrrid": json.dumps(about).encode()}), tmp_path / "a.parquet")
    with pytest.raises(InputRejected, match=f"RRID-S20 .*{key}"):
        open_log(tmp_path / "a.parquet")


def test_find_logs_passes_over_what_is_not_meant(tmp_path: Path) -> None:
    """Hidden files, temporary files, rrrid's own output, links to folders and circles of links are no inputs; a linked log is."""
    for name in ("a.h5", "deep/b.parquet", ".rrrid-tmp-1-x.h5", "own/logs/c.h5", "outside/d.h5"):
        (tmp_path / "in" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "in" / name).write_bytes(b"x")
    (tmp_path / "in/outside").rename(tmp_path / "outside")
    (tmp_path / "in/own/provenance.json").write_text("{}")
    (tmp_path / "in/link.h5").symlink_to(tmp_path / "outside/d.h5")
    (tmp_path / "in/loop").symlink_to(tmp_path / "in")
    (tmp_path / "in/x.h5").symlink_to("y.h5")
    (tmp_path / "in/y.h5").symlink_to("x.h5")
    paths, checks = find_logs([tmp_path / "in"])
    assert [p.relative_to(tmp_path / "in").as_posix() for p in paths] == ["a.h5", "deep/b.parquet", "link.h5"]
    assert {(c.code, Path(c.where).name) for c in checks} == {("RRID-X11", name) for name in ("loop", "x.h5", "y.h5")}
    assert [p.name for p in find_logs([tmp_path / "in/own"])[0]] == ["c.h5"]
