"""Write files so that a reader sees the old one or the new one, never anything else.

A file is written under a hidden name beside its target, flushed to the disk and moved over it in one step. A folder is
filled under a hidden name and exchanged with its predecessor in one step.
"""

from __future__ import annotations

import contextlib
import errno
import os
import platform
import shutil
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

from pipelines.errors import EnvironmentFault, RrridError, UsageError

__all__ = ["environment_faults", "remove_folder", "replace_folder", "staging_folder", "staging_place", "sweep",
           "temporary_folder", "write_file"]

_MARK = ".rrrid-tmp-"


@contextlib.contextmanager
def environment_faults(path: Path) -> Iterator[None]:
    """Turn an OSError while writing below `path` into the fault of the environment that it is (exit 6)."""
    try:
        yield
    except BrokenPipeError:  # who read our words has left: no fault of any file
        raise
    except OSError as problem:
        raise fault_of(problem, path) from problem
    except RuntimeError as problem:
        # HDF5 cannot close a file whose last bytes found no room, and h5py says that instead of why.
        if not isinstance(problem.__context__, OSError):
            raise
        raise fault_of(problem.__context__, path) from problem


def fault_of(problem: OSError, path: Path) -> RrridError:
    """The environment fault behind an operating-system error, at the file it names, or at `path` where that is a draft.

    A path that this system cannot have is wrong usage instead (C07).
    """
    named = problem.filename
    where = named if named and not os.path.basename(os.fsdecode(named)).startswith(_MARK) else path
    if problem.errno in (errno.ENAMETOOLONG, errno.ELOOP):
        return UsageError("C07", "not a path of this system", where=where, remedy="check the path")
    if problem.errno == errno.EFBIG:
        return EnvironmentFault("P02", "larger than this process may write", where=where, remedy="raise its limit (ulimit -f)")
    if problem.errno in (errno.ENOSPC, errno.EDQUOT):
        return EnvironmentFault("P02", "no space left on the disk", where=where, remedy="free space and run again")
    if problem.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return EnvironmentFault("F13", "permission denied", where=where, remedy="choose another --out, or change its permissions")
    reason = os.strerror(problem.errno) if problem.errno else str(problem)
    return EnvironmentFault("P02", f"cannot be read or written: {reason}", where=where, remedy="check the disk and the path")


def write_file(path: Path, fill: Callable[[Path], None]) -> None:
    """Let `fill` write a hidden file beside `path`, then move it over `path` in one step.

    Inside a folder that is being filled nothing is flushed to the disk yet: `replace_folder` does it for all of it at once.

    Raises:
        EnvironmentFault: disk full, no permission. The old file is then untouched and nothing partial is left.
    """
    with environment_faults(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        # The ending stays: writers choose the container by it.
        sweep(path.parent)
        staged = any(part.startswith(_MARK) for part in path.parts[:-1])
        draft = path.parent / f"{_prefix()}{os.getpid()}-{os.urandom(4).hex()}{path.suffix}"
        try:
            fill(draft)
            if not staged:
                _sync(draft)
            os.replace(draft, path)
        except BaseException:
            draft.unlink(missing_ok=True)
            raise
        if not staged:
            _sync(path.parent)


def staging_folder(target: Path) -> Path:
    """An empty hidden folder beside `target`, to be filled and given to `replace_folder`.

    What a killed process left behind there is swept away first.
    """
    with environment_faults(target):
        folder = staging_place(target)
        folder.mkdir()
        return folder


def staging_place(target: Path) -> Path:
    """Where it will be: for who has to remove it even if interrupted while it is made."""
    with environment_faults(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        sweep(target.parent)
        return target.parent / f"{_prefix()}{os.getpid()}-{os.urandom(4).hex()}"


def temporary_folder() -> Path:
    """An empty folder in the system's place for temporary files, to be removed by the caller; what killed processes left is swept.

    Raises:
        EnvironmentFault: there is no such place, or no room in it.
    """
    import tempfile

    return staging_folder(Path(tempfile.gettempdir()) / "rrrid")


def remove_folder(folder: Path) -> None:
    """A hidden folder and all that is in it, if it is there; wholly, even if interrupted meanwhile."""
    try:
        shutil.rmtree(folder, ignore_errors=True)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def replace_folder(staging: Path, target: Path, aside: Path | None = None) -> None:
    """Put `staging` in the place of `target` in one step, and remove what stood there; or move it to `aside` before.

    Killed between those two moves, what stood there is in `aside`, whole, and nothing in its place yet.
    """
    with environment_faults(target):
        for path in staging.rglob("*"):
            _sync(path)
        _sync(staging)
        if aside is not None:
            _moved_aside(staging, target, aside)
        elif not target.exists():
            os.replace(staging, target)
        elif _exchange(staging, target):
            shutil.rmtree(staging)
        else:
            old = staging.with_name(f"{staging.name}.old")
            os.replace(target, old)
            os.replace(staging, target)
            shutil.rmtree(old)
        _sync(target.parent)


def _moved_aside(staging: Path, target: Path, aside: Path) -> None:
    """`target` becomes `aside` and `staging` becomes `target`: both or neither."""
    os.replace(target, aside)
    try:
        os.replace(staging, target)
    except BaseException:
        os.replace(aside, target)
        raise


def _prefix() -> str:
    """The beginning of this machine's drafts: another machine's processes cannot be asked whether they live."""
    return f"{_MARK}{zlib.crc32(platform.node().encode()):08x}-"


def sweep(folder: Path) -> None:
    """Remove what killed processes of this machine left behind in `folder`."""
    for left in folder.glob(f"{_prefix()}*"):
        number = left.name.removeprefix(_prefix()).split("-")[0]
        if not number.isdigit() or _alive(int(number)):
            continue
        if left.is_dir():
            shutil.rmtree(left, ignore_errors=True)
        else:
            left.unlink(missing_ok=True)


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    try:  # Linux: one that is dead, and whose parent has not taken notice, still has its number
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (OSError, IndexError):
        return True


def _exchange(a: Path, b: Path) -> bool:
    """Swap two folders atomically where the kernel can (Linux renameat2, RENAME_EXCHANGE); False where it cannot."""
    import ctypes

    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:
        return False
    at_cwd, exchange = -100, 2
    return bool(rename(at_cwd, os.fsencode(a.absolute()), at_cwd, os.fsencode(b.absolute()), exchange) == 0)


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as problem:
        # Some file systems cannot sync a folder; that is no reason to lose the result.
        if problem.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(handle)
