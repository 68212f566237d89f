"""Write results: a reader sees the old file or folder or the new one, never anything else.

A file is written under a hidden name beside its target and moved over it. A folder is filled under
a hidden name and takes the place of rrrid's own earlier output; any other folder is refused (C05).
"""

from __future__ import annotations

import contextlib
import dataclasses
import errno
import hashlib
import json
import os
import platform
import re
import shutil
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

from pipelines.errors import EnvironmentFault, RrridError, UsageError, clean

PROVENANCE = "provenance.json"
_MARK = ".rrrid-tmp-"
_OLD = "-of-"  # between the name of a draft and that of the folder whose place it takes
_ELSEWHERE = "choose another folder with --out"
_RESERVED = re.compile(r"(CON|PRN|AUX|NUL|COM[1-9]|LPT[1-9])(\..*)?", re.IGNORECASE)
_FULL = ("no space left on the disk", "free space and run again")
_FAULTS = {
    errno.ENOSPC: _FULL,
    errno.EDQUOT: _FULL,
    errno.EFBIG: ("larger than this process may write", "raise its limit (ulimit -f)"),
}


@contextlib.contextmanager
def environment_faults(path: Path) -> Iterator[None]:
    """Turn an OSError while writing below `path` into the fault of the environment (exit 6)."""
    try:
        yield
    except BrokenPipeError:  # the reader of our output has left: no fault of a file
        raise
    except OSError as problem:
        raise fault_of(problem, path) from problem
    except RuntimeError as problem:
        # HDF5 cannot close a file whose last bytes found no room, and h5py says that instead.
        if not isinstance(problem.__context__, OSError):
            raise
        raise fault_of(problem.__context__, path) from problem


def fault_of(problem: OSError, path: Path) -> RrridError:
    """Return the error behind an operating-system error, at the file it names or at `path`."""
    named = problem.filename
    draft = named and os.path.basename(os.fsdecode(named)).startswith(_MARK)
    where = named if named and not draft else path
    if problem.errno in (errno.ENAMETOOLONG, errno.ELOOP):
        return UsageError("C07", "not a path of this system", where, "check the path")
    if problem.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return _denied(where)
    reason = os.strerror(problem.errno) if problem.errno else str(problem)
    other = (f"cannot be read or written: {reason}", "check the disk and the path")
    words, remedy = _FAULTS.get(problem.errno or 0, other)
    return EnvironmentFault("P02", words, where, remedy)


def _denied(where: object) -> EnvironmentFault:
    remedy = "choose another --out, or change its permissions"
    return EnvironmentFault("F13", "permission denied", where, remedy)


def hash_file(path: Path) -> str:
    """Return the SHA-256 of the bytes of `path`, in hexadecimal."""
    with environment_faults(path), path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_file(path: Path, fill: Callable[[Path], object]) -> None:
    """Let `fill` write a hidden file beside `path`, then move it over `path`.

    Inside a staging folder nothing is flushed yet: `replace_folder` does it for all at once.

    Raises:
        EnvironmentFault: disk full, no permission; the old file is untouched.
    """
    with environment_faults(path):
        place = staging_place(path)
        draft = place.with_name(f"{place.name}{path.suffix}")  # writers look at the ending
        staged = any(part.startswith(_MARK) for part in path.parts[:-1])
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


def write_text(path: Path, text: str) -> None:
    """Write `text` to `path` as UTF-8, whole or not at all."""
    write_file(path, lambda draft: draft.write_text(text, encoding="utf-8"))


def staging_place(target: Path) -> Path:
    """Return a free hidden name beside `target`; what killed processes left there is removed."""
    with environment_faults(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        sweep(target.parent)
        return target.parent / f"{_machine()}{os.getpid()}-{os.urandom(4).hex()}"


def staging_folder(target: Path) -> Path:
    """Make an empty hidden folder beside `target`, to be given to `replace_folder`."""
    folder = staging_place(target)
    with environment_faults(target):
        folder.mkdir()
    return folder


def remove_folder(folder: Path) -> None:
    """Remove a folder and all that is in it, wholly even if interrupted meanwhile."""
    try:
        shutil.rmtree(folder, ignore_errors=True)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def replace_folder(staging: Path, target: Path) -> None:
    """Put `staging` in the place of `target`, and remove what was there.

    A folder cannot be moved over another: the old one gets a hidden name first. Of a process that
    is killed between the two moves, `sweep` brings the old folder back.
    """
    with environment_faults(target):
        for path in (*staging.rglob("*"), staging):
            _sync(path)
        name = f"{staging.name}{_OLD}{target.name}"
        fits = len(os.fsencode(name)) <= os.pathconf(target.parent, "PC_NAME_MAX")
        old = staging.with_name(name if fits else f"{staging.name}-")  # that is not brought back
        if target.exists():
            os.replace(target, old)
        try:
            os.replace(staging, target)
        except BaseException:
            if old.exists():
                os.replace(old, target)
            raise
        try:
            if old.exists():
                shutil.rmtree(old)
        finally:
            remove_folder(old)
        _sync(target.parent)


def _machine() -> str:
    """Return how hidden names begin: with the machine, which can ask its processes alone."""
    return f"{_MARK}{zlib.crc32(platform.node().encode()):08x}-"


def sweep(folder: Path) -> None:
    """Remove what killed processes of this machine left in `folder`; bring back a moved result."""
    for left in folder.glob(f"{_machine()}*"):
        process = left.name.removeprefix(_machine()).split("-")[0]
        if not process.isdigit() or _alive(int(process)):
            continue
        target = folder / left.name.partition(_OLD)[2]
        if target != folder and not target.exists():
            with contextlib.suppress(FileNotFoundError):  # another process has done so
                os.replace(left, target)
        elif left.is_dir():
            shutil.rmtree(left, ignore_errors=True)
        else:
            left.unlink(missing_ok=True)


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
        # Linux: a dead process whose parent has not waited for it still has its number
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except ProcessLookupError:
        return False
    except (OSError, IndexError):
        return True


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as problem:
        if problem.errno not in (errno.EINVAL, errno.ENOTSUP):  # some file systems sync no folder
            raise
    finally:
        os.close(handle)


def refuse_place(
    out: Path, sources: Iterable[Path], folders: Iterable[Path], inside: bool = False
) -> None:
    """Refuse an `out` that holds one of the `sources`, lies in an input folder or cannot be made.

    Args:
        inside: the command writes into an `out` that is there; else it replaces it with another.

    Raises:
        UsageError: C05. EnvironmentFault: F13, no permission.
    """
    target = out.resolve()
    for source in sources:
        # a link in `out` would be deleted as well
        linked = Path(os.path.abspath(source)).is_relative_to(os.path.abspath(out))
        if linked or source.resolve().is_relative_to(target):
            raise _refused(out, f"holds the input {source}, and would be replaced with it")
    for folder in folders:
        if os.path.isdir(folder) and target.is_relative_to(folder.resolve()):
            raise _refused(out, f"lies inside the input {folder}")
    places = out.absolute().parents
    if not places:
        raise _refused(out, "is the root of the file system")
    above = out if inside and out.is_dir() else next(path for path in places if path.exists())
    if not above.is_dir():
        raise _refused(out, f"lies below {above}, which is not a folder")
    if not os.access(above, os.W_OK | os.X_OK):
        raise _denied(above)


def _refused(out: Path, words: str, instead: str = "") -> UsageError:
    return UsageError("C05", words, out, f"{_ELSEWHERE}{instead}")


def refuse_foreign(
    out: Path,
    force: bool = False,
    remade: Callable[[str], bool] = lambda name: False,
    command: str = "",
) -> tuple[str, ...]:
    """Refuse an output folder that is not new, empty, or rrrid's own earlier output (C05).

    Args:
        force: replace rrrid's output of any command, and with files added or changed since.
        remade: own files, by their names in `out`, that are made again where changed (P10).
        command: refuse the output of another command than this one; "" for none.

    Returns:
        The names of the files that are made again.
    """
    if out.is_symlink() or (out.exists() and not out.is_dir()):
        raise _refused(out, "is not a folder")
    with contextlib.suppress(FileNotFoundError):
        if Path.cwd().is_relative_to(out.resolve()):  # a shell would stay in the old one
            words = "is the folder you are in, or around it, and would be replaced under you"
            raise _refused(out, words, ", or call from outside of it (cd)")
    ours = listed_outputs(out)
    if not out.exists() or not any(out.iterdir()) or (ours and force):
        return ()
    known = {*ours, PROVENANCE} if ours else set()
    if foreign := list(islice((name for name in _members(out) if name not in known), 3)):
        words = f"holds files that rrrid did not write there: {', '.join(foreign)}"
        raise _refused(out, words, ", or move them")
    if command and written_by(out) != command:
        words = f"holds the earlier result of {clean(written_by(out), 40)}"
        raise _refused(out, words, ", or replace it with --force")
    edited = [
        name for name in _members(out) if name in ours and hash_file(out / name) != ours[name]
    ]
    if kept := [name for name in edited if not remade(name)]:
        words = f"holds files that were changed since rrrid wrote them: {', '.join(kept[:3])}"
        raise _refused(out, words, ", or replace them with --force")
    return tuple(edited)


def _members(folder: Path, above: str = "") -> Iterator[str]:
    """Yield the names of all files below `folder`, in order; also of unreadable folders."""
    for name in sorted(os.listdir(folder)):
        path = folder / name
        if path.is_symlink() or not path.is_dir() or not os.access(path, os.R_OK | os.X_OK):
            yield f"{above}{name}"
        else:
            yield from _members(path, f"{above}{name}/")


def provenance_of(folder: Path) -> dict[str, Any]:
    """Return the provenance.json of rrrid's own output in `folder`; empty where there is none."""
    try:
        about = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return about if isinstance(about, dict) and about.get("tool") == "rrrid" else {}


def listed_outputs(folder: Path) -> dict[str, str]:
    """Map the files of rrrid's own output in `folder` to their SHA-256; empty for none."""
    outputs = provenance_of(folder).get("outputs")
    return outputs if isinstance(outputs, dict) else {}


def written_by(folder: Path) -> str:
    """Return the command whose output `folder` is; "" where it is none."""
    return str(provenance_of(folder).get("command", ""))


def slug(text: str) -> str:
    """Return `text` as a file name: [A-Za-z0-9._-], at most 80, hashed where changed (X11)."""
    plain = re.sub(r"[^A-Za-z0-9._-]+", "-", text).strip("-.")[:69]
    reserved = _RESERVED.fullmatch(plain) is not None
    if plain == text and plain and not reserved:
        return plain
    digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:8]
    return f"{'x-' if reserved else ''}{plain or 'x'}-{digest}"


def short_names(paths: Iterable[Path]) -> dict[str, str]:
    """Map every input folder to its name in a result: "" for one, else unlike the others.

    A result then does not depend on where its inputs lie: equal inputs give equal bytes.
    """
    roots = dict.fromkeys(path if os.path.isdir(path) else path.parent for path in paths)
    if len(roots) == 1:
        return {str(root): "" for root in roots}
    names: dict[str, str] = {}
    for root in roots:
        name, number = root.name, 2
        while name and name in names.values():
            name, number = f"{root.name}-{number}", number + 1
        names[str(root)] = name
    return names


def renamed(value: Any, names: Mapping[str, str]) -> Any:
    """Return `value` with every path that begins with one of `names` written by its name."""
    roots = sorted((root for root in names if root != os.sep), key=len, reverse=True)
    # messages hold the path as `clean` leaves it, on one line
    rules = [(text, names[root]) for root in roots for text in dict.fromkeys((root, clean(root)))]

    def rename(text: str) -> str:
        for place, name in rules:
            if place not in text:
                continue
            below, itself = (f"{name}/", name) if name else ("", ".")
            pattern = rf"(?<![^\s,:;(\['\"]){re.escape(place)}(?:(/)|(?![^\s,:;)\]'\"]))"
            text = re.sub(pattern, lambda found: below if found[1] else itself, text)  # noqa: B023
        return text

    return _texts(value, rename) if rules else value


def tilde(value: Any) -> Any:
    """Return `value` with the home folder written as ~, so that no report names its user (X14)."""
    home = os.path.expanduser("~")
    return _texts(value, lambda text: text.replace(home, "~")) if len(home) > 1 else value


def _texts(value: Any, change: Callable[[str], str]) -> Any:
    """Return `value` with `change` done to its texts; the very object where nothing changed."""
    if isinstance(value, str | Path):
        text = change(str(value))
        return value if text == str(value) else type(value)(text)
    if isinstance(value, Mapping):
        return {_texts(key, change): _texts(item, change) for key, item in value.items()}
    if isinstance(value, list | tuple):
        items = [_texts(item, change) for item in value]
        same = all(new is old for new, old in zip(items, value, strict=True))
        return value if same else type(value)(items)
    if not dataclasses.is_dataclass(value) or isinstance(value, type):
        return value
    changes = {}
    for field in dataclasses.fields(value):
        if field.init and field.metadata.get("stored", True):
            old = getattr(value, field.name)
            new = _texts(old, change)
            if new is not old:
                changes[field.name] = new
    return dataclasses.replace(value, **changes) if changes else value
