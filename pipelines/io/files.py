"""Open, find and write logs: the door between files on disk and `ExperimentLog`.

opened = open_log(path)         guarded, checked against digest, manifest and format; in SI
paths, checks = find_logs([..]) the logs among files and folders
write_log(path, log)            .h5 or .parquet, atomically
"""

from __future__ import annotations

import contextlib
import glob
import os
import shlex
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipelines.errors import (
    Check,
    EnvironmentFault,
    InputRejected,
    NothingMatched,
    UsageError,
    clean,
)
from pipelines.io import hdf5, parquet, schema
from pipelines.io.log import (
    ExperimentLog,
    Signal,
    assembled,
    columns_in,
    digest_of,
    parts_of,
    refuse_bad_signals,
    refuse_unlike_format,
    select_joints,
    with_robot,
)
from pipelines.io.output import (
    PROVENANCE,
    environment_faults,
    fault_of,
    hash_file,
    listed_outputs,
    write_file,
)
from pipelines.io.robot import RobotDescription
from pipelines.io.sandbox import Answer, guarded, regular_file
from pipelines.io.schema import Array
from pipelines.io.units import to_si

# `import` reads JSON too, but so are results
RECORDINGS = (".csv", ".txt", ".tsv", ".dat", ".mat", ".npy", ".npz", ".jsonl")
ENDINGS = {".h5": "hdf5", ".hdf5": "hdf5", ".parquet": "parquet"}
PLANS = ("trajectory.h5", "trajectory.parquet")  # of design-excitation, beside its logs/

_HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
_PARQUET_MAGIC = b"PAR1"
_ARCHIVES = (b"PK\x03\x04", b"\x1f\x8b", b"7z\xbc\xaf", b"BZh", b"\xfd7zXZ")
_RECIPE = (
    "a log is .h5 or .parquet; 'rrrid import' makes one of .csv, .txt, .mat and .npy by a recipe, "
    "which 'rrrid import --guess FILE' drafts"
)


@dataclass(frozen=True)
class Opened:
    """A log, the file it came from, and what was changed or remarked on the way."""

    path: Path
    sha256: str
    log: ExperimentLog
    checks: tuple[Check, ...]
    container: str = "hdf5"  # or "parquet": by the content, not by the name


def write_log(path: Path | str, log: ExperimentLog) -> None:
    """Write `log` to `path`, the container chosen by its ending, atomically.

    Raises:
        InputRejected: the log is not what the format says.
        UsageError: C02, the ending names no container.
        EnvironmentFault: disk full, no permission; the old file at `path` is untouched.
    """
    path = Path(path)
    container = ENDINGS.get(path.suffix.lower())
    if container is None:
        words, remedy = f"'{path.suffix}' names no container", "end the name in .h5 or .parquet"
        raise UsageError("C02", words, path, remedy)
    refuse_unlike_format(log)
    write = hdf5.write if container == "hdf5" else parquet.write
    write_file(path, lambda draft: write(draft, parts_of(log)))


def write_csv(path: Path, log: ExperimentLog) -> None:
    """Write the signals of `log` as one flat CSV table, each number with all its digits."""
    import pandas as pd

    columns = {}
    for name, signal in log.signals.items():
        for column, values in parquet.columns_of({name: signal.values}).items():
            columns[f"{column} [{signal.units}]"] = values
    table = pd.DataFrame(columns)
    write_file(path, lambda draft: table.to_csv(draft, index=False, na_rep="nan"))


def open_log(
    path: Path | str,
    *,
    assume_units: bool = False,
    only: Collection[str] | None = None,
    joints: tuple[int, ...] = (),
    robot: RobotDescription | None = None,
) -> Opened:
    """Read the log in `path`, in a guarded child, and check it against digest and format.

    Args:
        assume_units: take signals without units as SI (S04).
        only: the signals to read, t, q and tau always among them; default all. A part is not
            checked against the digest, but by the checksums of its own chunks and pages.
        joints: the joints to take, 1-based, in this order; default all (S02).
        robot: the description to use instead of the log's own.

    Raises:
        InputRejected: the file is damaged, hostile or not a log.
        EnvironmentFault: no permission, or another program is writing it.
    """
    path = Path(path)
    status = regular_file(path)
    wanted = None if only is None else {"t", "q", "tau", *only}
    with environment_faults(path), _reading(path) as handle:
        sha256 = hash_file(path)
        container, checks = _container(path, os.pread(handle, 8, 0), status.st_size)
        _refuse_unlisted(path, sha256)
        read = hdf5.read_parts if container == "hdf5" else parquet.read_parts
        parts = guarded(lambda: read(path, wanted), path)
    log = _verified(parts, path, whole=only is None)
    if parts.about["digest"] is None:
        words = "no integrity data: nothing would notice a flipped bit"
        remedy = "'rrrid convert' writes a copy that has them"
        checks.append(Check.of("F05", "warn", words, path, remedy))
    if joints:
        names, columns = ", ".join(map(str, joints)), columns_in(log)
        words = f"joints {names} of {columns} are used, as --joints says"
        checks.append(Check.of("S02", "warn", words, path, "leave --joints out to use all"))
        log = select_joints(log, joints, robot)
    if robot is not None:
        log = with_robot(log, robot)
    log = _conform(log, assume_units, checks)
    _refuse_bad_urdf(log)
    return Opened(path, sha256, log, tuple(checks), container)


def _verified(parts: Answer, path: Path, *, whole: bool) -> ExperimentLog:
    """Return the log as it is written, checked against the digest that it carries."""
    log, digest = assembled(parts, str(path)), parts.about["digest"]
    if digest is not None and not isinstance(digest, str):
        words = "attribute 'digest' is not a text"
        raise InputRejected("S20", words, path, "write it as a text, or leave it out")
    if whole and digest is not None and digest != digest_of(log):
        remedy = (
            "copy the file again from where it was recorded; if it was edited on purpose, "
            "delete its attribute digest, which may be left out"
        )
        words = "checksum mismatch: the content does not fit its digest"
        raise InputRejected("F04", words, path, remedy)
    return log


@contextlib.contextmanager
def _reading(path: Path) -> Iterator[int]:
    """Open with a shared lock, which fails at once where a program is writing (F15).

    A file that is another afterwards is refused (F14), before its content is blamed.
    """
    import fcntl

    wait = "wait until the recording is finished"
    with environment_faults(path):
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        with contextlib.suppress(OSError):  # of a file system without locks
            try:
                fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                raise EnvironmentFault("F15", "in use by another process", path, wait) from None
        before = os.fstat(handle)
        try:
            yield handle
        finally:
            for now in (os.fstat(handle), path.stat()):
                same = (now.st_size, now.st_mtime_ns, now.st_ino)
                if same != (before.st_size, before.st_mtime_ns, before.st_ino):
                    raise InputRejected("F14", "was modified while it was read", path, wait)
    finally:
        os.close(handle)


def _container(path: Path, magic: bytes, size: int) -> tuple[str, list[Check]]:
    """Return what the content says it is; the file's name is only worth a warning (F06).

    The library that reads it is imported here, before the fork: every child has it then.
    """
    if magic == _HDF5_MAGIC:
        import h5py  # noqa: F401

        container = "hdf5"
    elif magic[:4] == _PARQUET_MAGIC:
        import pyarrow.parquet  # noqa: F401

        container = "parquet"
        with path.open("rb") as file:
            file.seek(max(0, size - 4))
            if file.read() != _PARQUET_MAGIC:
                remedy = "copy the file again from where it was recorded"
                raise InputRejected("F07", "truncated: no footer", path, remedy)
    elif magic.startswith(_ARCHIVES) and path.suffix.lower() not in ENDINGS:
        remedy = "unpack it, and give the logs or their folder"
        raise UsageError("X12", "an archive, which is not opened", path, remedy)
    else:
        raise InputRejected("F06", "neither HDF5 nor Parquet", path, _RECIPE)
    if ENDINGS.get(path.suffix.lower()) == container:
        return container, []
    words = f"named '{path.suffix}', but its content is {container}; read as that"
    return container, [Check.of("F06", "warn", words, path, "rename it")]


def _refuse_unlisted(path: Path, sha256: str) -> None:
    """Refuse a file that differs from a manifest beside it or one folder up (F05)."""
    for folder in (path.parent, path.parent.parent):
        name, expected = path.relative_to(folder).as_posix(), None
        with contextlib.suppress(OSError, UnicodeDecodeError):
            lines = (folder / "SHA256SUMS").read_text(encoding="utf-8").splitlines()
            listed = (line.partition(" ") for line in lines)
            expected = {entry.strip().lstrip("*"): value for value, _, entry in listed}.get(name)
        expected = listed_outputs(folder).get(name, expected)
        if expected not in (None, sha256):
            words = f"sha256 differs from the manifest in {folder.name or folder}"
            remedy = "copy the file again, or run the command that wrote it again"
            raise InputRejected("F05", words, path, remedy)


def _refuse_bad_urdf(log: ExperimentLog) -> None:
    """Look at the URDF of a description here, where the file is known (S17, X13)."""
    if "urdf_text" not in log.robot_text or log.robot.urdf_text is None:
        return
    from pipelines.io.urdf import chain_from_urdf

    try:
        chain_from_urdf(log.robot.urdf_text, log.robot.tip_link)
    except InputRejected as problem:
        problem.where = clean(f"{log.source or log.name}, /robot, {problem.where}")
        raise


def _conform(log: ExperimentLog, assume_units: bool, checks: list[Check]) -> ExperimentLog:
    """Return `log` in SI and in the format's orientation; what is changed is added to `checks`.

    Raises:
        InputRejected: it is not what the format says and has no single reading (S01-S20).
    """
    refuse_bad_signals(log)
    law = log.controller.law if log.controller else None
    signals = {}
    for name, signal in log.signals.items():
        where = f"{log.source or log.name}, signal {name}"
        turned, remedy = _turned(log, name, signal.values)
        if remedy:
            words = f"stored as {signal.values.shape}, read as {turned.shape}"
            checks.append(Check.of("S11", "warn", words, where, remedy))
        if turned is not signal.values:
            signal = replace(signal, values=turned)
        signals[name] = _in_si(name, signal, law, where, assume_units, checks)
    if any(signals[name] is not log.signals[name] for name in signals):
        log = replace(log, signals=signals)
    refuse_unlike_format(log)
    return log


def _turned(log: ExperimentLog, name: str, values: Array) -> tuple[Array, str]:
    """Return samples as (samples, joints), t as a vector; and what to store, where it differs."""
    n, samples = log.n_joints, log.t.size
    if name == "t":
        column = values.ndim > 1 and 1 in values.shape
        return (values.reshape(-1), "store t as a vector") if column else (values, "")
    if n == 1 and values.shape == (samples,):
        return values[:, None], ""
    if values.shape == (n, samples) and n != samples:
        return np.ascontiguousarray(values.T), "store (samples, joints)"
    return values, ""


def _in_si(
    name: str, signal: Signal, law: str | None, where: str, assume_units: bool, checks: list[Check]
) -> Signal:
    """Convert declared units; refuse undeclared ones unless the user vouches for SI (S04-S06)."""
    wanted = schema.unit_of(name, law)
    if signal.units == wanted:
        return signal
    if signal.units.strip():
        unit = to_si(signal.units, schema.quantity_of(name, law), where=where)
        if unit.is_si:
            return replace(signal, units=wanted)
        words = f"declared in {signal.units}, converted to {wanted}"
        remedy = "store SI units, if results should not list the conversion"
        checks.append(Check.of("S06", "warn", words, where, remedy))
        return replace(signal, values=unit.factor * signal.values + unit.offset, units=wanted)
    if not assume_units:
        remedy = "declare them, or pass --assume-units if they are SI"
        raise InputRejected("S04", f"no units; {wanted} is what the format wants", where, remedy)
    words = f"no units; taken as {wanted}, as --assume-units says"
    checks.append(Check.of("S04", "warn", words, where, "write the attribute units"))
    return replace(signal, units=wanted)


def expanded(inputs: Iterable[Path]) -> tuple[Path, ...]:
    """Return `inputs` with every pattern (*, ?, [ ]) replaced by what it matches.

    Raises:
        NothingMatched: C06, a pattern matches nothing.
    """
    found: list[Path] = []
    for path in inputs:
        if os.path.lexists(path) or not glob.has_magic(str(path)):
            found.append(path)
            continue
        matches = sorted(glob.glob(str(path), recursive=True))
        if not matches:
            words, remedy = "nothing matches that pattern", "logs end in .h5 or .parquet"
            raise NothingMatched("C06", words, path, remedy)
        found += map(Path, matches)
    return tuple(dict.fromkeys(found))


def find_logs(
    inputs: Iterable[Path], unreadable: list[Path] | None = None
) -> tuple[tuple[Path, ...], tuple[Check, ...]]:
    """Return the logs named by `inputs`: files as they are, folders searched below.

    Hidden files, and folders that rrrid itself wrote, are passed over, unless such a folder is
    named: then its logs are meant. A link to a log is that log; links to folders, and those that
    lead nowhere, are passed over with a warning.

    Args:
        unreadable: takes the folders that cannot be listed; None: the first one is an error.

    Raises:
        UsageError: an input does not exist.
        EnvironmentFault: F13, a folder cannot be listed.
        NothingMatched: there is no log at all.
    """
    inputs, found = tuple(inputs), _Found([], [], [], [], unreadable)
    for path in inputs:
        if not os.path.isdir(path):
            regular_file(path)
            found.logs.append(path)
        elif not (path / PROVENANCE).is_file():
            _search(path, found)
        else:
            if (path / "logs").is_dir():
                _search(path / "logs", found)
            found.logs.extend(plan for name in PLANS if (plan := path / name).is_file())
    if found.logs or unreadable:
        return tuple(dict.fromkeys(found.logs)), tuple(found.checks)
    words, remedy = "no log there", "logs end in .h5 or .parquet"
    if found.passed:
        words += f"; links and results of rrrid are passed over, here {len(found.passed)}"
        remedy = f"give what is meant by its own path: {shlex.join(map(str, found.passed[:3]))}"
    elif found.recordings:
        words += f", but recordings such as {found.recordings[0].name}"
        draft = f"rrrid import --guess {shlex.quote(str(found.recordings[0]))}"
        remedy = f"make logs of them; this drafts the recipe: {draft}"
    raise NothingMatched("C06", words, ", ".join(map(str, inputs)), remedy)


@dataclass(frozen=True)
class _Found:
    """The logs below some folders, and what was passed over."""

    logs: list[Path]
    checks: list[Check]
    passed: list[Path]  # links, and results of rrrid
    recordings: list[Path]
    unreadable: list[Path] | None


def _search(folder: Path, found: _Found) -> None:
    """Add what is in a folder and in those below it, in order."""
    try:
        entries = sorted(folder.iterdir())
        os.stat(f"{folder}/.")  # listing and entering a folder are two permissions
    except OSError as problem:
        if found.unreadable is None:
            raise fault_of(problem, folder) from None
        found.unreadable.append(folder)
        return
    for entry in entries:
        is_log, is_folder = entry.suffix.lower() in ENDINGS, entry.is_dir()
        if entry.name.startswith("."):
            continue
        if entry.is_symlink() and (is_folder or (is_log and not entry.exists())):
            what = "to a folder" if is_folder else "that leads nowhere, or in a circle,"
            remedy = "give what is meant by its own path, or remove it"
            found.checks.append(Check.of("X11", "warn", f"link {what} passed over", entry, remedy))
            found.passed.append(entry)
        elif is_folder and os.path.isfile(entry / PROVENANCE):
            found.passed.extend([entry] * (entry / "logs").is_dir())
        elif is_folder:
            _search(entry, found)
        elif is_log and entry.exists():
            found.logs.append(entry)
        elif entry.suffix.lower() in RECORDINGS:
            found.recordings.append(entry)
