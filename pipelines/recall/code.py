"""Which source files a stage consists of: its module and whatever that imports from here, however deep."""

from __future__ import annotations

import hashlib
import re
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from platform import python_version

import pipelines

__all__ = ["code_of", "libraries"]

_ROOT = Path(pipelines.__file__).parent
_IMPORT = re.compile(r"^[ \t]*(?:from[ \t]+(pipelines[\w.]*)[ \t]+import[ \t]+(\([^)]*\)|[^\n]*)|import[ \t]+(pipelines[\w.]*))",
                     re.M)
_BY_NAME = re.compile(r"\bimport_module\(")  # a package that finds its members consists of all of them
_DIGITS = 12


@lru_cache(maxsize=64)
def code_of(module: str, without: tuple[str, ...] = ()) -> dict[str, str]:
    """Every module that `module` consists of -> the hash of its source, the beginning of it.

    Args:
        without: packages that have no part in what is asked: "pipelines.report" draws, and computes nothing.
    """
    found: dict[str, str] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name in found or any(f"{name}.".startswith(f"{left}.") for left in without):
            continue
        if (path := _path(name)) is None:
            continue
        found[name], imported = _read(path, name)
        waiting += imported
    return dict(sorted(found.items()))


def _path(module: str) -> Path | None:
    base = _ROOT.joinpath(*module.split(".")[1:])
    for path in (base / "__init__.py", base.with_suffix(".py")):
        if path.is_file():
            return path
    return None


@lru_cache(maxsize=1024)
def _read(path: Path, module: str) -> tuple[str, tuple[str, ...]]:
    """The hash of a source file, and the modules of ours that it names, with the packages they are in."""
    source = path.read_bytes()
    text = source.decode("utf-8")
    named: set[str] = set()
    for whence, what, whole in _IMPORT.findall(text):
        named |= {whole or whence, *(f"{whence}.{word}" for word in re.findall(r"\w+", what) if whence)}
    if path.name == "__init__.py" and _BY_NAME.search(text):
        named |= {f"{module}.{other.stem}" for other in path.parent.glob("*.py") if other != path}
    packages = {".".join(name.split(".")[:k]) for name in named for k in range(1, name.count(".") + 1)}
    return hashlib.sha256(source).hexdigest()[:_DIGITS], tuple(sorted(named | packages))


@lru_cache(maxsize=8)
def libraries(names: tuple[str, ...] = ("numpy", "scipy", "h5py", "pyarrow", "pandas", "filterpy")) -> dict[str, str]:
    """The versions of Python and of the libraries whose arithmetic and file formats a result rests on."""
    found = {"python": python_version()}
    for name in names:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "missing"
    return found
