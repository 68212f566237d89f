"""Open, find and write logs: the one door between files on disk and `ExperimentLog`.

    opened = open_log(path)         guarded, checked against digest, manifest and format; .log is in SI
    paths, checks = find_logs([..]) the logs among files and folders
    write_log(path, log)            .h5 or .parquet, atomically
"""

from __future__ import annotations

import contextlib
import errno
import glob
import hashlib
import json
import os
import shlex
import stat
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from pipelines.errors import Check, EnvironmentFault, InputRejected, NothingMatched, UsageError
from pipelines.io.atomic import environment_faults, fault_of, write_file
from pipelines.io.experiment import ExperimentLog
from pipelines.io.joints import chosen
from pipelines.io.log_reader import read_guarded
from pipelines.io.robot import RobotDescription
from pipelines.io.structure import conform, refuse_bad_urdf, refuse_unlike_format

__all__ = ["ENDINGS", "PROVENANCE", "RECORDINGS", "Opened", "entries", "expanded", "find_logs", "hash_file", "nothing_there",
           "open_log", "regular_file", "write_log"]

RECORDINGS = (".csv", ".txt", ".tsv", ".dat", ".mat", ".npy", ".npz", ".jsonl")  # `import` reads JSON too, but so are results
ENDINGS = {".h5": "hdf5", ".hdf5": "hdf5", ".parquet": "parquet"}

_HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
_PARQUET_MAGIC = b"PAR1"
_ARCHIVES = (b"PK\x03\x04", b"\x1f\x8b", b"7z\xbc\xaf", b"BZh", b"\xfd7zXZ")
PROVENANCE = "provenance.json"
PLANS = ("trajectory.h5", "trajectory.parquet")  # of design-excitation, beside its logs/


@dataclass(frozen=True)
class Opened:
    """A log, the file it came from, and what had to be said or mended on the way."""

    path: Path
    sha256: str
    log: ExperimentLog
    checks: tuple[Check, ...]
    container: str = "hdf5"  # or "parquet": what the content is, whatever the file's name says


def write_log(path: Path | str, log: ExperimentLog) -> None:
    """Write `log` to `path`, the container chosen by its ending, atomically.

    Raises:
        InputRejected: the log is not what the format says.
        UsageError: C02, the ending names no container.
        EnvironmentFault: disk full, no permission; what stood at `path` is untouched.
    """
    path = Path(path)
    container = ENDINGS.get(path.suffix.lower())
    if container is None:
        raise UsageError("C02", f"'{path.suffix}' names no container", where=path, remedy="end the name in .h5 or .parquet")
    refuse_unlike_format(log)
    if container == "hdf5":
        from pipelines.io.hdf5 import write
    else:
        from pipelines.io.parquet import write
    write_file(path, lambda draft: write(draft, log))


def open_log(path: Path | str, *, assume_units: bool = False, only: Collection[str] | None = None, joints: tuple[int, ...] = (),
             robot: RobotDescription | None = None) -> Opened:
    """Read the log in `path`, in a guarded child, and hold it against its digest, its manifest and the format.

    Args:
        assume_units: take signals without units as SI (S04).
        only: the signals to read, t, q and tau always among them; default all. A part cannot be held against the
            digest of the whole: what vouches for it then are the checksums of its own chunks and pages.
        joints: the joints to take, 1-based, in this order; default all (S02).
        robot: the description to use instead of the log's own.

    Raises:
        InputRejected: the file is damaged, hostile or not a log.
        EnvironmentFault: no permission, or another program is writing it.
    """
    return _open(Path(path), assume_units, only, joints, robot)


def _open(path: Path, assume_units: bool, only: Collection[str] | None, joints: tuple[int, ...],
          robot: RobotDescription | None) -> Opened:
    status = regular_file(path)
    with environment_faults(path), _reading(path) as handle:
        sha256 = hash_file(path)
        container, checks = _container(path, os.pread(handle, 8, 0), status.st_size)
        _against_manifest(path, sha256)
        log, digest = read_guarded(path, container, only, lambda: _refuse_modified(path, handle, status))
    if digest is None:
        checks.append(Check.of("F05", "warn", "no integrity data: nothing would notice a flipped bit", where=path,
                               remedy="'rrrid convert' writes a copy that has them"))
    log, choice = chosen(log, joints, robot)
    conformed, changes = conform(log, assume_units=assume_units)
    refuse_bad_urdf(conformed, path)
    return Opened(path, sha256, conformed, (*checks, *choice, *changes), container)


def _refuse_modified(path: Path, handle: int, before: os.stat_result) -> None:
    """F14: the open file, or what now stands under its name, is not what it was."""
    for now in (os.fstat(handle), path.stat()):
        if (now.st_size, now.st_mtime_ns, now.st_ino) != (before.st_size, before.st_mtime_ns, before.st_ino):
            raise InputRejected("F14", "was modified while it was read", where=path, remedy="wait until the recording is finished")


def regular_file(path: Path, *, what: str = "a log, or a folder of logs", empty: bool = False) -> os.stat_result:
    """The status of `path`, which must be a regular file (F12, F13) and hold something unless `empty` (F01)."""
    try:
        status = path.stat()
    except FileNotFoundError:
        raise UsageError("C04", "no such file", where=path, remedy="check the path") from None
    except (OSError, ValueError) as problem:
        if isinstance(problem, ValueError) or problem.errno in (errno.ENAMETOOLONG, errno.ELOOP):
            raise UsageError("C07", "not a path of this system", where=path, remedy="check the path") from None
        raise fault_of(problem, path) from None
    if not stat.S_ISREG(status.st_mode):
        raise InputRejected("F12", "not a regular file", where=path, remedy=f"give {what}")
    if not os.access(path, os.R_OK):
        raise EnvironmentFault("F13", "permission denied", where=path, remedy="change its permissions")
    if status.st_size == 0 and not empty:
        raise InputRejected("F01", "empty file", where=path, remedy="copy it again, or record again")
    return status


class _reading:
    """An open handle with a shared lock, which fails at once where a program is writing (F15)."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __enter__(self) -> int:
        import fcntl

        try:
            self.handle = os.open(self.path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError as problem:
            raise fault_of(problem, self.path) from None
        try:
            fcntl.flock(self.handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(self.handle)
            raise EnvironmentFault("F15", "in use by another process", where=self.path,
                                   remedy="wait until the recording is finished") from None
        except OSError:
            pass  # a file system without locks cannot say; the digest will
        return self.handle

    def __exit__(self, *_: object) -> None:
        os.close(self.handle)


def hash_file(path: Path) -> str:
    """SHA-256 of the bytes of `path`, in hexadecimal."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as problem:
        raise fault_of(problem, path) from None


def _container(path: Path, magic: bytes, size: int) -> tuple[str, list[Check]]:
    """What the content says it is (F06); the name is only worth a warning."""
    if magic == _HDF5_MAGIC:
        container = "hdf5"
        import h5py  # noqa: F401  imported before the fork, so that every child has it
    elif magic[:4] == _PARQUET_MAGIC:
        container = "parquet"
        import pyarrow.parquet  # noqa: F401
        with path.open("rb") as file:
            file.seek(max(0, size - 4))
            if file.read() != _PARQUET_MAGIC:
                raise InputRejected("F07", "truncated: no footer", where=path,
                                    remedy="copy the file again from where it was recorded")
    elif magic.startswith(_ARCHIVES) and path.suffix.lower() not in ENDINGS:
        raise UsageError("X12", "an archive, which is not opened", where=path,
                         remedy="unpack it, and give the logs or their folder")
    else:
        raise InputRejected("F06", "neither HDF5 nor Parquet", where=path,
                            remedy="a log is .h5 or .parquet; 'rrrid import' makes one of .csv, .txt, .mat and .npy by a recipe, "
                            "which 'rrrid import --guess FILE' drafts")
    if ENDINGS.get(path.suffix.lower()) == container:
        return container, []
    return container, [Check.of("F06", "warn", f"named '{path.suffix}', but its content is {container}; read as that", where=path,
                                remedy="rename it")]


def _against_manifest(path: Path, sha256: str) -> None:
    """F05: a provenance.json or SHA256SUMS beside the file, or one folder up, may say what its bytes must be."""
    for folder in (path.parent, path.parent.parent):
        expected = _listed(folder, path)
        if expected is not None and expected != sha256:
            raise InputRejected("F05", f"sha256 differs from the manifest in {folder.name or folder}", where=path,
                                remedy="copy the file again, or run the command that wrote it again")


def _listed(folder: Path, path: Path) -> str | None:
    name = path.relative_to(folder).as_posix()
    try:
        outputs = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))["outputs"]
        if isinstance(outputs.get(name), str):
            return str(outputs[name])
    except (OSError, ValueError, KeyError, AttributeError, TypeError, RecursionError):
        pass  # no manifest, or not one of ours
    try:
        lines = (folder / "SHA256SUMS").read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return None
    return {entry.strip().lstrip("*"): value for value, _, entry in (line.partition(" ") for line in lines)}.get(name)


def expanded(inputs: Iterable[Path]) -> tuple[Path, ...]:
    """`inputs` with every pattern (*, ?, [ ]) that the shell left as it was replaced by what it matches.

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
            raise NothingMatched("C06", "nothing matches that pattern", where=path, remedy="logs end in .h5 or .parquet")
        found += map(Path, matches)
    return tuple(dict.fromkeys(found))


def find_logs(inputs: Iterable[Path]) -> tuple[tuple[Path, ...], tuple[Check, ...]]:
    """The logs named by `inputs`: files as they are, folders searched below.

    Hidden files, and folders that rrrid itself wrote, are passed over, unless such a folder is named: then its logs
    are meant. A link to a log is that log; links to folders, and those that lead nowhere, are passed over with a warning.

    Raises:
        UsageError: an input does not exist.
        NothingMatched: there is no log at all.
    """
    found: list[Path] = []
    checks: list[Check] = []
    inputs = tuple(inputs)
    for path in inputs:
        if not os.path.isdir(path):  # unlike Path.is_dir, it answers for a path that is none
            regular_file(path)
            found.append(path)
            continue
        own = (path / PROVENANCE).is_file()
        root = path / "logs" if own else path
        found += sorted(_below(root, checks))
        found += [plan for plan in (path / name for name in PLANS) if own and plan.is_file()]
    if not found:
        raise nothing_there(", ".join(map(str, inputs)), checks, [path for path in inputs if os.path.isdir(path)])
    return tuple(dict.fromkeys(found)), tuple(checks)


def nothing_there(where: object, checks: Sequence[Check], folders: Sequence[Path]) -> NothingMatched:
    """C06, there is no log; with what to give instead: links to folders (X11) and results of rrrid, which are passed over unless
    they are named, or recordings, of which `import` makes logs.
    """
    passed, remedy = "", "logs end in .h5 or .parquet"
    links = [str(check.where) for check in checks if check.code == "RRID-X11"]
    own = [path.parent for path in _within(folders, PROVENANCE) if path.parent not in folders]
    results = [str(folder) for folder in own if (folder / "logs").is_dir()]
    if over := list(dict.fromkeys([*links, *results])):
        passed = f"; links and results of rrrid are passed over, here {len(over)}"
        there = [path for path in over if os.path.isdir(path)]
        remedy = f"give what is meant by its own path: {shlex.join(there[:3])}{' …' * (len(there) > 3)}" if there else remedy
    elif recorded := next((path for path in _within(folders, "*") if path.suffix.lower() in RECORDINGS), None):
        passed = f", but recordings such as {recorded.name}"
        remedy = f"make logs of them; this drafts the recipe: rrrid import --guess {shlex.quote(str(recorded))}"
    return NothingMatched("C06", f"no log there{passed}", where=where, remedy=remedy)


def _within(folders: Sequence[Path], pattern: str) -> list[Path]:
    """Return the files that match `pattern` in `folders` and two levels below, without hidden ones."""
    with contextlib.suppress(OSError):
        return [path for folder in folders for above in ("", "*/", "*/*/") for path in sorted(folder.glob(f"{above}{pattern}"))
                if path.is_file() and not any(part.startswith(".") for part in path.relative_to(folder).parts)]
    return []


def _below(folder: Path, checks: list[Check]) -> list[Path]:
    try:
        there = entries(folder, checks)
    except FileNotFoundError:
        return []
    except OSError as problem:
        raise fault_of(problem, folder) from None
    return [path for entry in there for path in (_below(entry, checks) if entry.is_dir() else [entry])]


def entries(folder: Path, checks: list[Check]) -> list[Path]:
    """Logs in `folder` and folders to look into, in order; links to folders and to nothing are passed over with a word (X11).

    Raises:
        OSError: the folder cannot be read.
    """
    found = []
    for entry in sorted(folder.iterdir()):
        if entry.name.startswith("."):
            continue
        if entry.is_symlink() and entry.is_dir():
            checks.append(Check.of("X11", "warn", "link to a folder passed over", where=entry,
                                   remedy="give what it leads to by its own path, if that is meant"))
        elif entry.is_symlink() and not entry.exists():
            if entry.suffix.lower() in ENDINGS:
                checks.append(Check.of("X11", "warn", "link that leads nowhere, or in a circle, passed over", where=entry,
                                       remedy="remove it, or let it lead to a log"))
        elif entry.is_dir():
            if not (entry / PROVENANCE).is_file():
                found.append(entry)
        elif entry.suffix.lower() in ENDINGS and entry.exists():
            found.append(entry)
    return found

