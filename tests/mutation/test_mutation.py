"""Damaged bytes, whatever they say: every reader takes them or refuses them in words, in bounded time and memory.

In CI each reader meets fifteen; the campaign is `pytest -m slow tests/mutation -s -k hdf5`, ten thousand a reader. Texts (robots,
recipes, settings, tables, URDFs) are damaged by `benchmarks.mutations`.
"""

from __future__ import annotations

import io
import json
import os
import resource
import signal
import time
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from benchmarks.mutations import mutations, read_apart, warm_up
from pipelines import import_log
from pipelines.dynamics.arm import Arm
from pipelines.dynamics.body import Motion
from pipelines.errors import RrridError
from pipelines.io.files import open_log, write_log
from pipelines.io.model_file import read_model
from pipelines.stage import Request
from tests.importers.good import RECIPE, good
from tests.importers.test_matlab import mat73, signals
from tests.io.logs import small_log

SAMPLES = Path(__file__).parents[2] / "sample_logs"
SECONDS, BYTES, HUNG = 10.0, 1e9, 30
FEW, MANY = 15, int(os.environ.get("RRRID_MUTATIONS", "10000"))
TOKENS = (b"\x00", b"\xff" * 4, b"\x00" * 8, b"\n", b'"', b"[", b",", b"1e308", b"nan", b"-inf", b"4294967296", b"1" + b"0" * 40, b"null", b"-1")


@dataclass(frozen=True)
class Reader:
    """Good files, and what is done with a damaged one: it raises what the command would end with."""

    ending: str
    seeds: Callable[[Path], list[bytes]]
    work: Callable[[Path], None]


def logs(ending: str) -> Callable[[Path], list[bytes]]:
    def make(folder: Path) -> list[bytes]:
        write_log(folder / f"a{ending}", small_log(samples=40))
        return [(folder / f"a{ending}").read_bytes()]

    return make


def same_log(path: Path) -> None:
    assert open_log(path).log == small_log(samples=40), "a checksummed log was read with other numbers"


def mat_files(folder: Path) -> list[bytes]:
    brief, found = {name: values[:40] for name, values in signals().items()}, []
    for version, packed in (("5", False), ("5", True), ("4", False)):
        scipy.io.savemat(folder / "a.mat", brief, do_compression=packed, format=version)
        found.append((folder / "a.mat").read_bytes())
    return [*found, mat73(folder / "a.mat").read_bytes()]


def npy_files(folder: Path) -> list[bytes]:
    columns, found = np.column_stack(list(good().values()))[:60], []
    for array in (columns, np.asfortranarray(columns), columns.astype(np.float32)):
        np.save(buffer := io.BytesIO(), array)
        found.append(buffer.getvalue())
    return found


def recording(path: Path) -> None:
    """Import it by a good recipe."""
    recipe = path.parent.parent / "recipe.toml"
    said = RECIPE.replace('"*.csv"', f'"*{path.suffix}"')
    if path.suffix == ".npy":
        said = said.replace('"tau_{j}"', "[5, 6, 7]").replace('"q_{j}"', "[2, 3, 4]").replace('"t"', "1")
    recipe.write_text(said)
    settings = import_log.Settings(recipe=str(recipe), source=path.parent)
    import_log.STAGE.report(import_log.STAGE.compute(import_log.STAGE.read(Request(()), settings), settings))


def model(path: Path) -> None:
    arm = Arm.from_model(read_model(path), path)
    if arm.n_joints == 3:
        arm.torque(Motion(1e-3 * np.arange(5), *np.full((3, 5, 3), 0.1), 1e-3))


READERS = {
    "hdf5": Reader(".h5", logs(".h5"), same_log),
    "parquet": Reader(".parquet", logs(".parquet"), same_log),
    "mat": Reader(".mat", mat_files, recording),
    "npy": Reader(".npy", npy_files, recording),
    "model": Reader(".json", lambda folder: [(SAMPLES / "models/rrr.json").read_bytes()], model),
}


def damaged(data: bytes, rng: np.random.Generator) -> bytes:
    """One to four flips, cuts, copies and foreign values."""
    for _ in range(rng.integers(1, 5)):
        at, token = int(rng.integers(len(data) + 1)), TOKENS[rng.integers(len(TOKENS))]
        to = at + int(rng.integers(1, 65))
        flipped = bytes([data[at] ^ 1 << int(rng.integers(8))]) if at < len(data) else b""
        kinds = (data[:at] + flipped + data[at + 1:], data[:at] + token + data[at + len(token):], data[:at] + token + data[at:],
                 data[:at] + data[to:], data[:to] + data[at:], data[:at])
        data = kinds[rng.integers(len(kinds))]
    return data


def outcome(work: Callable[[Path], None], path: Path) -> tuple[int, str, float, float]:
    """Read in a process of its own: exit code (70 for an error of ours, -N for a signal), words, seconds, bytes."""
    ours, theirs = os.pipe()
    began = time.monotonic()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # a fork beside threads: this child takes none of their locks
        child = os.fork()
    if child == 0:
        signal.alarm(HUNG)
        warnings.simplefilter("ignore")  # as in the command; the tests make errors of them
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        try:
            work(path)
            ended: tuple[int, str] = (0, "")
        except RrridError as problem:
            ended = (problem.exit_code, str(problem)) if problem.code and problem.remedy else (70, f"incomplete: {problem}")
        except BaseException as problem:
            ended = (70, repr(problem)[:200])
        peak = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
        os.write(theirs, json.dumps([*ended, peak * 1024]).encode())
        os._exit(0)
    os.close(theirs)
    with os.fdopen(ours, "rb") as end:
        said = end.read()
    _, status = os.waitpid(child, 0)
    code, words, memory = json.loads(said) if said else (-os.WTERMSIG(status), "", 0)
    return code, words, time.monotonic() - began, memory


def hold(name: str, folder: Path, count: int) -> None:
    """Exit 0 or 3, place and remedy said, in 10 s and 1 GB; a checksummed log is itself."""
    reader, rng = READERS[name], np.random.default_rng(20260)
    place = folder / "data" / f"a{reader.ending}"
    place.parent.mkdir()
    seeds, exits = reader.seeds(folder), Counter[int]()
    for number in range(len(seeds) + count):
        data = seeds[number] if number < len(seeds) else damaged(seeds[rng.integers(len(seeds))], rng)
        place.write_bytes(data)
        tried = [outcome(reader.work, place)]
        while tried[-1][2] > SECONDS and len(tried) < 3:  # a machine that stood still for a while is not the file's
            tried.append(outcome(reader.work, place))
        code, words, seconds, memory = min(tried, key=lambda one: (one[0] in (0, 3), one[2]))
        (folder / "last").write_bytes(data)
        assert code == 0 if number < len(seeds) else code in (0, 3), words
        assert seconds <= SECONDS
        assert memory <= BYTES
        exits[code] += 1
    print(name, dict(exits))
    assert exits[3] > count // 10, "a campaign of which nothing was refused has damaged nothing"


@pytest.mark.parametrize("name", READERS)
def test_a_damaged_file_is_read_or_refused(name: str, tmp_path: Path) -> None:
    hold(name, tmp_path, FEW)


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
def test_ten_thousand_damaged_files(name: str, tmp_path: Path) -> None:
    hold(name, tmp_path, MANY)


def test_a_damaged_text_is_read_or_refused() -> None:
    warm_up()
    for kind, text in mutations(60, seed=7):
        reading = read_apart(kind, text)
        assert not reading.outcome.startswith("internal"), (kind, reading.outcome)
        assert reading.seconds < 5.0
        assert reading.megabytes < 500.0
