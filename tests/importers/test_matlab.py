"""MAT and NumPy files: numbers come out exactly, everything else is refused before it is built."""

from __future__ import annotations

import io
import pickle
import zipfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io

from pipelines.errors import InputRejected, UsageError
from pipelines.importers.arrays import read_npy
from pipelines.importers.raw import expand, table_of
from pipelines.importers.tables import read_table
from tests.importers.good import good


def signals() -> dict[str, np.ndarray[Any, Any]]:
    columns = good()
    return {"t": columns["t"], "q": np.column_stack([columns[f"q_{j}"] for j in (1, 2, 3)]),
            "tau": np.column_stack([columns[f"tau_{j}"] for j in (1, 2, 3)])}


def mat5(path: Path, content: dict[str, Any], **options: Any) -> Path:
    scipy.io.savemat(path, content, **options)
    return path


def mat73(path: Path, transposed: bool = True) -> Path:
    """As MATLAB writes -v7.3: a user block with the version, arrays by columns, a class attribute."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in signals().items():
            matrix = np.atleast_2d(values) if values.ndim == 1 else values.T if transposed else values
            file.create_dataset(name, data=matrix).attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return path


def npy(array: np.ndarray[Any, Any], pickled: bool = False) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=pickled)
    return buffer.getvalue()


def assert_good(path: Path) -> None:
    table = read_table(path)
    assert all(np.array_equal(table.columns[name], values) for name, values in good().items())


@pytest.mark.parametrize("compressed", [False, True])
def test_mat5_is_read_exactly(tmp_path: Path, compressed: bool) -> None:
    assert_good(mat5(tmp_path / "run.mat", signals(), do_compression=compressed))


def test_an_array_of_structures_has_a_column_for_each_series_of_each_joint(tmp_path: Path) -> None:
    """joint(k) with a name, positions and torques: none takes the place of another."""
    joint = np.empty((1, 3), dtype=[(field, object) for field in ("name", "pos", "trq")])
    for j in range(3):
        joint[0, j] = (f"axis {j + 1}", good()[f"q_{j + 1}"][:, None], good()[f"tau_{j + 1}"][:, None])
    scipy.io.savemat(tmp_path / "run.mat", {"joint": joint, "tout": good()["t"][:, None]})
    table = read_table(tmp_path / "run.mat")
    assert np.array_equal(table.columns["axis 2.pos"], good()["q_2"])
    assert np.array_equal(table.columns["axis 3.trq"], good()["tau_3"])


def test_a_structure_is_opened_one_level(tmp_path: Path) -> None:
    table = read_table(mat5(tmp_path / "run.mat", {"data": signals(), "note": "hello"}))
    assert np.array_equal(table.columns["data.q_2"], good()["q_2"])
    assert expand(table, "data.q", 3, "q") == ("data.q_1", "data.q_2", "data.q_3")


def test_mat73_is_read_exactly(tmp_path: Path) -> None:
    assert_good(mat73(tmp_path / "run.mat"))


@pytest.mark.parametrize("share", [0.02, 0.3, 0.7, 0.999])
@pytest.mark.parametrize("version", ["5", "5z", "7.3"])
def test_f08_a_truncated_mat_file_is_refused_in_one_way(tmp_path: Path, version: str, share: float) -> None:
    path = mat73(tmp_path / "run.mat") if version == "7.3" else mat5(tmp_path / "run.mat", signals(),
                                                                     do_compression=version == "5z")
    whole = path.read_bytes()
    path.write_bytes(whole[: max(130, int(share * len(whole)))])
    with pytest.raises(InputRejected, match="RRID-(F08 run.mat: truncated or damaged MAT file|S12)"):
        read_table(path)


def test_s12_integers_beyond_the_mantissa_are_refused() -> None:
    table = table_of({"n": np.arange(50) + 2**60, "q": np.arange(50.0)}, "run.npy")
    with pytest.raises(InputRejected, match="RRID-S12.*2\\^53"):
        table.name_of("n")


def test_s11_a_matrix_that_lies_on_its_side_is_turned() -> None:
    table = table_of({"q": signals()["q"].T}, "run.npy")
    assert np.array_equal(table.columns["q_3"], good()["q_3"])
    assert [(c.code, c.level) for c in table.checks] == [("RRID-S11", "warn")]


def test_x12_an_npz_archive_is_read_and_one_of_other_files_is_not(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    np.savez_compressed(path, **signals())
    assert np.array_equal(read_table(path).columns["q_3"], good()["q_3"])
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(InputRejected, match="RRID-F08 run.npz: truncated"):
        read_table(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("../q.txt", "0")
    with pytest.raises(UsageError, match="RRID-X12"):
        read_table(path)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("q.npy", bytes(150_000_000))
    with pytest.raises(InputRejected, match=r"RRID-(X05|F08|F02)"):
        read_table(path)


def test_s11_a_square_matrix_is_refused() -> None:
    with pytest.raises(InputRejected, match="RRID-S11.*which side is time"):
        table_of({"q": np.zeros((20, 20))}, "run.npy")


def test_x01_an_external_link_is_refused(tmp_path: Path) -> None:
    path = mat73(tmp_path / "run.mat")
    with h5py.File(path, "r+") as file:
        file["secret"] = h5py.ExternalLink("other.h5", "/q")
    with pytest.raises(InputRejected, match="RRID-X01.*'secret'"):
        read_table(path)


def test_x02_external_storage_is_refused(tmp_path: Path) -> None:
    path = mat73(tmp_path / "run.mat")
    with h5py.File(path, "r+") as file:
        file.create_dataset("leak", (4,), "f8", external=[("/etc/passwd", 0, 32)])
    with pytest.raises(InputRejected, match="RRID-X02.*'leak'"):
        read_table(path)


def test_x03_virtual_data_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        layout = h5py.VirtualLayout((10,), "f8")
        layout[:] = h5py.VirtualSource("missing.h5", "q", (10,))
        file.create_virtual_dataset("q", layout)
    with pytest.raises(InputRejected, match="RRID-X03"):
        read_table(path)


def test_x05_a_huge_declared_data_set_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("q", (10**9, 6), "f8", chunks=(65536, 1), compression="gzip")
    with pytest.raises(InputRejected, match="RRID-X05"):
        read_table(path)


def test_x07_objects_are_never_unpickled(tmp_path: Path) -> None:
    class Bomb:
        def __reduce__(self) -> tuple[Any, ...]:
            return Path.touch, (tmp_path / "exploded",)

    (tmp_path / "run.npy").write_bytes(npy(np.array([Bomb()], dtype=object), pickled=True))
    (tmp_path / "run.pkl").write_bytes(pickle.dumps(Bomb()))
    for name in ("run.npy", "run.pkl"):
        with pytest.raises(InputRejected, match="RRID-X07"):
            read_table(tmp_path / name)
    assert not (tmp_path / "exploded").exists()


def test_npy_fields_are_read_by_name(tmp_path: Path) -> None:
    columns = signals()
    array = np.zeros(len(columns["t"]), dtype=[("t", "f8"), ("q", "f8", (3,)), ("tau", "f8", (3,))])
    for name, values in columns.items():
        array[name] = values
    (tmp_path / "run.npy").write_bytes(npy(array))
    assert_good(tmp_path / "run.npy")


def test_f02_a_truncated_npy_file_says_how_much_is_there() -> None:
    content = npy(signals()["q"])
    with pytest.raises(InputRejected, match=rf"RRID-F02.*{len(content) - 9} of {len(content)} bytes"):
        read_npy(content[:-9], "run.npy")
