"""Rows X: files made to mislead, through the command. Nothing they point at is opened, nothing they hold is run or shown raw."""

from __future__ import annotations

import csv
import os
import pickle
import re
import time
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from pipelines.io.files import write_log
from pipelines.io.output import hash_file
from tests.healthy import good_log
from tests.importers.good import RECIPE
from tests.io.logs import small_log
from tests.io.test_hostile import _replace_q
from tests.rows.commanded import Command

REPO = Path(__file__).resolve().parents[2]
row = pytest.mark.row
HOSTILE = "<script>alert(1)</script></svg>--> $a_{ [/bold] \x1b]0;owned\x07\x1b[31m =cmd|'/C calc'!A0"


def _external_raw(file: h5py.File) -> None:
    """The bytes of another file, a pipe: whoever opened it would hang."""
    pipe = Path(file.filename).parent / "pipe"
    os.mkfifo(pipe)
    _replace_q(file, lambda g: g.create_dataset("q", (2000, 3), "f8", external=[(str(pipe), 0, 48000)]))


def _virtual(file: h5py.File) -> None:
    layout = h5py.VirtualLayout((2000, 3), "f8")
    layout[:] = h5py.VirtualSource("missing.h5", "q", (2000, 3))
    _replace_q(file, lambda g: g.create_virtual_dataset("q", layout))


def _attributes(file: h5py.File) -> None:
    for i in range(3000):
        file.attrs[f"a{i}"] = 1


def _bomb(file: h5py.File) -> None:
    """480 MB of zeros in half a megabyte, every chunk there: as dense as gzip can be."""
    _replace_q(file, lambda g: g.create_dataset("q", (20_000_000, 3), "f8", chunks=(1_000_000, 3), compression="gzip"))
    chunk = zlib.compress(bytes(24_000_000), 9)
    for k in range(20):
        file["signals/q"].id.write_direct_chunk((k * 1_000_000, 0), chunk)


CASES: dict[str, tuple[str, Callable[[h5py.File], object], str]] = {
    "external link": ("X01", lambda f: _replace_q(f, lambda g: g.__setitem__("q", h5py.ExternalLink("secret.h5", "/signals/q"))),
                      "external link 'q' -> 'secret.h5'"),
    "external raw storage": ("X02", _external_raw, "external raw storage"),
    "virtual": ("X03", _virtual, "virtual data"),
    "soft-link loop": ("X04", lambda f: _replace_q(f, lambda g: g.__setitem__("q", h5py.SoftLink("/signals/q"))), "soft link 'q'"),
    "3000 attributes": ("X04", _attributes, "attributes"),
    "24 TB": ("X05", lambda f: _replace_q(f, lambda g: g.create_dataset("q", (10**12, 3), "f8", chunks=(65536, 1))), "declares 24"),
    "gzip bomb": ("X05", _bomb, "declares 4"),
}


@pytest.mark.parametrize("name", [pytest.param(name, marks=[row(case[0]), *([row("X06")] if "bomb" in name else [])])
                                  for name, case in CASES.items()])
def test_hdf5_that_misleads(name: str, command: Command, tmp_path: Path) -> None:
    """Refused by what it declares, within a second or two, by name of the data set or the link."""
    code, edit, says = CASES[name]
    write_log(tmp_path / "secret.h5", small_log())
    write_log(tmp_path / "a.h5", small_log())
    with h5py.File(tmp_path / "a.h5", "a", **({"libver": "latest"} if code == "X04" else {})) as file:
        del file.attrs["digest"]
        edit(file)
    began = time.monotonic()
    command("convert", "a.h5", "--out", "out").refused(code, 3, "a.h5", says)
    assert time.monotonic() - began < 3.0
    assert not (tmp_path / "out").exists()


@row("X02")
def test_a_result_of_somebody_else_is_drawn_without_opening_what_it_points_at(command: Command, tmp_path: Path) -> None:
    """A folder sent along, its provenance true of its bytes: a series that lies in a pipe is refused, not waited for."""
    write_log(tmp_path / "a.h5", small_log())
    command("inspect", "a.h5", "--no-report", "--out", "out")
    assert command("report", "out", as_json=False).exit == 0
    series, provenance = tmp_path / "out/result.h5", tmp_path / "out/provenance.json"
    os.mkfifo(tmp_path / "pipe")
    before = hash_file(series)
    with h5py.File(series, "a") as file:
        names: list[str] = []
        file.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
        del file[names[0]]
        file.create_dataset(names[0], (2000,), "f8", external=[(str(tmp_path / "pipe"), 0, 16000)])
    provenance.write_text(provenance.read_text().replace(before, hash_file(series)))
    done = command("report", "out", as_json=False)
    assert (done.exit, done.err.split(":")[1].split()[0]) == (3, "RRID-X02"), done.err


@row("X04")
def test_deep_groups(command: Command, tmp_path: Path) -> None:
    """500 groups, one in the other: nobody goes down."""
    write_log(tmp_path / "a.h5", small_log())
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file.create_group("/".join("d" * 500))
    began = time.monotonic()
    command("convert", "a.h5").refused("X04", 3, "a.h5", "group 'd' is not in format version 1, and not looked into")
    assert time.monotonic() - began < 3.0  # a second, and two for a busy machine


@pytest.mark.slow
@row("X04")
def test_thirty_thousand_attributes(command: Command, tmp_path: Path) -> None:
    """Counted, not read."""
    write_log(tmp_path / "a.h5", small_log())
    with h5py.File(tmp_path / "a.h5", "a", libver="latest") as file:
        del file.attrs["digest"]
        space, kind = h5py.h5s.create(h5py.h5s.SCALAR), h5py.h5t.NATIVE_INT8
        for i in range(30_000):
            h5py.h5a.create(file["signals/q"].id, b"a%d" % i, kind, space)
    began = time.monotonic()
    command("convert", "a.h5").refused("X04", 3, "a.h5", "attributes")
    assert time.monotonic() - began < 3.0  # a second, and two for a busy machine


@row("X06")
def test_a_parquet_bomb(command: Command, tmp_path: Path) -> None:
    """448 MB of one value in 200 kB: judged by rows and columns, not by what the footer says of bytes."""
    write_log(tmp_path / "a.parquet", small_log())
    metadata = pq.read_schema(tmp_path / "a.parquet").metadata
    zeros = pa.array(np.zeros(8_000_000))
    columns = dict.fromkeys(("t", "q_1", "q_2", "q_3", "tau_1", "tau_2", "tau_3"), zeros)
    pq.write_table(pa.table(columns).replace_schema_metadata(metadata), tmp_path / "a.parquet")
    assert (tmp_path / "a.parquet").stat().st_size < 400_000
    command("convert", "a.parquet").refused("X06", 3, "a.parquet", "declares 448 MB")


class _Touch:
    def __reduce__(self) -> tuple[object, ...]:
        return os.mkdir, ("pwned",)


@row("X07")
def test_a_pickle_is_never_opened(command: Command, tmp_path: Path) -> None:
    """As a log, as a recording, inside NPY, inside MAT, inside an attribute."""
    (tmp_path / "data").mkdir()
    for name, content in (("a.npy", pickle.dumps(_Touch())), ("b.npy", b"")):
        (tmp_path / "data" / name).write_bytes(content)
    np.save(tmp_path / "data/b.npy", np.array([_Touch()] * 30), allow_pickle=True)
    for name in ("a", "b"):
        (tmp_path / "r.toml").write_text(RECIPE.replace("*.csv", f"{name}.npy"))
        command("import", "r.toml", "--source", "data").refused("X07", 3, f"{name}.npy", "save")
    (tmp_path / "a.h5").write_bytes(pickle.dumps(_Touch()))
    command("convert", "a.h5").refused("F06", 3, "a.h5")
    write_log(tmp_path / "b.h5", small_log())
    with h5py.File(tmp_path / "b.h5", "a") as file:
        file.attrs["name"] = np.void(pickle.dumps(_Touch()))
    command("convert", "b.h5").refused("S12", 3, "b.h5")
    assert not (tmp_path / "pwned").exists()


@row("X08", "X09")
def test_texts_of_a_log_are_inert(command: Command, tmp_path: Path) -> None:
    """In the report as text, under a policy that runs nothing; on the terminal without a control byte; in figures as written."""
    write_log(tmp_path / "a.h5", good_log())
    with h5py.File(tmp_path / "a.h5", "a") as file:
        del file.attrs["digest"]
        file.attrs["name"] = file.attrs["robot_name"] = HOSTILE
    done = command("inspect", "a.h5", "--out", "out", as_json=False)
    assert done.exit == 0, done.err
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]", done.out + done.err)
    page = (tmp_path / "out/report.html").read_text(encoding="utf-8")
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert" in page
    assert "Content-Security-Policy" in page
    assert "default-src 'none'" in page
    assert "\x1b" not in page
    for figure in (tmp_path / "out/figures").glob("*.svg"):
        assert "<script>alert" not in figure.read_text(encoding="utf-8")


@row("X09")
def test_an_error_carries_no_control_byte(command: Command, tmp_path: Path) -> None:
    write_log(tmp_path / "a.h5", small_log())
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file.attrs["\x1b]0;owned\x07[/bold]$a_{"] = 1
    done = command("convert", "a.h5", as_json=False)
    assert done.exit == 3
    assert "[/bold]$a_{" in done.err
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]", done.err)


@row("X10")
def test_no_cell_of_an_exported_table_is_a_formula(command: Command, tmp_path: Path) -> None:
    """Every cell of convert's CSV, whatever the log's texts say, begins as text or as a number."""
    write_log(tmp_path / "a.h5", small_log(name="=1+1", robot_name="@SUM(A1)"))
    assert command("convert", "a.h5", "--to", "csv", "--out", "out").exit == 0
    (table,) = (tmp_path / "out").rglob("*.csv")
    with table.open(newline="") as file:
        cells = [cell for line in list(csv.reader(file))[:50] for cell in line]
    assert cells
    assert not [c for c in cells if c.startswith(("=", "@", "+", "\t", "\r"))]
    assert not [c for c in cells if c.startswith("-") and not re.fullmatch(r"-[\d.e+-]+|-inf", c)]


@pytest.mark.parametrize("name", ["../../x", "/abs/x", "CON", "..", "a/../../b"])
@row("X11")
def test_no_name_leads_out_of_the_output(name: str, command: Command, tmp_path: Path) -> None:
    write_log(tmp_path / "in/deep/a.h5", small_log(name=name, robot_name=name))
    assert command("reconstruct", "in", "--no-report").exit in (0, 3)
    assert command("convert", "in").exit == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in", "runs"]
    assert not [p for p in (tmp_path / "runs").rglob("*") if p.name.split(".")[0].upper() == "CON"]


@row("X11")
def test_loops_of_links_are_not_followed(command: Command, tmp_path: Path) -> None:
    """A loop is passed over with a word, a linked log is read; an output that is a link is not written through."""
    write_log(tmp_path / "in/a.h5", small_log())
    write_log(tmp_path / "elsewhere too/b.h5", small_log(name="b"))
    (tmp_path / "in/loop").symlink_to(tmp_path / "in")
    (tmp_path / "in/circle.h5").symlink_to("circle.h5")
    (tmp_path / "in/b.h5").symlink_to(tmp_path / "elsewhere too/b.h5")
    done = command("inspect", "in", "--no-report", "--out", "out")
    assert sorted(Path(c["where"]).name for c in done.told("X11")) == ["circle.h5", "loop"]
    assert [log["name"] for log in done.object["logs"]] == ["small", "b"]
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere/thesis.tex").write_text("x")
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    assert command("convert", "in", "--out", "link").exit == 2
    assert [p.name for p in (tmp_path / "elsewhere").iterdir()] == ["thesis.tex"]


@row("X12")
def test_an_archive_is_not_unpacked(command: Command, tmp_path: Path) -> None:
    """Neither for import nor for any command that reads logs."""
    (tmp_path / "data").mkdir()
    with zipfile.ZipFile(tmp_path / "data/logs.zip", "w") as archive:
        archive.writestr("../../evil.h5", "x")
    command("convert", "data/logs.zip").refused("X12", 2, "logs.zip", "unpack")
    (tmp_path / "r.toml").write_text(RECIPE.replace("*.csv", "*.zip"))
    command("import", "r.toml", "--source", "data").refused("X12", 2, "logs.zip", "unpack")
    (tmp_path / "data/a.h5").write_bytes((tmp_path / "data/logs.zip").read_bytes())
    command("convert", "data").refused("F06", 3, "a.h5")  # one bad file of a folder, as any other


URDF = ('<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="revolute">'
        '<parent link="a"/><child link="b"/>{}</joint></robot>')


@pytest.mark.parametrize(("text", "says"), [
    ('<?xml version="1.0"?><!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]>' + URDF.format("&x;"), "DOCTYPE"),
    (URDF.format('<origin xyz="${length} 0 0"/>'), "xacro"),
    (URDF.format("").replace('name="r"', 'name="r" xmlns:xacro="http://ros.org/wiki/xacro"').replace(
        "<link", '<xacro:include filename="/etc/passwd"/><link', 1), "xacro")])
@row("X13")
def test_a_urdf_runs_nothing_and_reads_nothing(text: str, says: str, command: Command, tmp_path: Path) -> None:
    """As --robot, wrong usage; inside a log, a rejected log."""
    write_log(tmp_path / "a.h5", good_log())
    (tmp_path / "arm.urdf").write_text(text)
    command("convert", "a.h5", "--robot", "arm.urdf").refused("X13", 2, "arm.urdf", says)
    robot = "name = 'r'\ngravity = [0.0, 0.0, -9.81]\n" + 3 * "[[joint]]\nname = 'j'\ntype = 'revolute'\n"
    robot += "[kinematics]\nconvention = 'urdf'\n"
    robot += f"urdf_text = '''{text}'''\n"
    with h5py.File(tmp_path / "a.h5", "a") as file:
        del file.attrs["digest"], file["robot"]
        file["robot"] = robot
    command("convert", "a.h5").refused("X13", 3, "a.h5", says)


@row("X13")
def test_no_mesh_is_opened(command: Command, tmp_path: Path) -> None:
    """Of a path that leads out, and of a pipe that would hang whoever reads it."""
    os.mkfifo(tmp_path / "pipe.stl")
    mesh = '<link name="a"><visual><geometry><mesh filename="{}"/></geometry></visual></link>'
    for path in ("../../../etc/passwd", f"{tmp_path}/pipe.stl", "package://x/y.dae"):
        (tmp_path / "arm.urdf").write_text(URDF.format("").replace('<link name="a"/>', mesh.format(path)))
        write_log(tmp_path / "a.h5", small_log(controller=None))
        done = command("convert", "a.h5", "--robot", "arm.urdf")
        assert (done.exit, done.error["code"]) == (3, "RRID-S02")  # read, and found to have one joint


@row("X14")
def test_no_report_tells_the_home_folder_or_the_user(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of logs, robot and output below the home folder: `~` stands for it wherever a path is written."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USER", "alice-the-user")
    write_log(tmp_path / "logs/a.h5", good_log())
    (tmp_path / "arm.toml").write_text((REPO / "sample_logs/robots/rrr.toml").read_text())
    for words in (("convert", tmp_path / "logs"), ("inspect", tmp_path / "logs", "--robot", tmp_path / "arm.toml", "--no-report")):
        assert command(*words, "--out", tmp_path / "out", "--force").exit == 0
        for path in (p for p in (tmp_path / "out").rglob("*") if p.suffix in (".html", ".json", ".svg")):
            said = path.read_text(encoding="utf-8")
            assert str(tmp_path) not in said, path
            assert "alice-the-user" not in said, path
