"""Read MAT files of version 4 to 7 (scipy) and 7.3, and plain HDF5, as nested documents of arrays.

Sizes are checked before anything is read; objects are never built and cells stay closed.
"""

from __future__ import annotations

import io
import math
import struct
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pipelines.errors import InputRejected
from pipelines.importers.config import ARRAYS
from pipelines.importers.npy import too_large
from pipelines.importers.raw import Anything

_NUMERIC = ("double", "single", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32",
            "uint64", "logical")  # fmt: skip
_CLOSED = (b"char", "char", b"cell", "cell", b"function_handle", "function_handle")
# NameError: a local variable of scipy that damage leaves unset.
_BAD_MAT = (ValueError, TypeError, IndexError, KeyError, OSError, OverflowError, EOFError,
            AttributeError, NotImplementedError, struct.error, zlib.error, ZeroDivisionError,
            RuntimeError, AssertionError, MemoryError, NameError)  # fmt: skip


def damaged_mat(source: str) -> InputRejected:
    """Return F08, with the only sentence for it."""
    remedy = "copy it again, or save it again from MATLAB"
    return InputRejected("F08", "truncated or damaged MAT file", source, remedy)


def read_mat5(data: bytes, source: str) -> dict[str, Any]:
    """Return the numbers, texts and structures of a MAT file of version 4 to 7.

    Raises:
        InputRejected: F08 damaged, S03 a variable twice, S12 no number, X05 too large, X07 objects
            only.
    """
    from scipy.io import loadmat, whosmat
    from scipy.io.matlab import MatReadError, MatReadWarning

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)
            listed = whosmat(io.BytesIO(data))
            names = _wanted(listed, source)
            # Not mat_dtype=True, the type MATLAB shows: it would drop imaginary parts.
            loaded = loadmat(io.BytesIO(data), variable_names=names, simplify_cells=True)
    except MatReadWarning as problem:
        message, remedy = f"a variable is there twice: {problem}", "save each variable once"
        raise InputRejected("S03", message, source, remedy) from None
    except (*_BAD_MAT, MatReadError, UserWarning):
        raise damaged_mat(source) from None
    if not set(names) <= loaded.keys():
        raise damaged_mat(source)
    return {name: loaded[name] for name in names}


def _wanted(listed: list[tuple[str, tuple[int, ...], str]], source: str) -> list[str]:
    """X05, X07: return the names of what may be loaded, judged by the headers."""
    declared = sum(8 * math.prod(shape) for _, shape, kind in listed if kind in _NUMERIC)
    if declared > ARRAYS.budget or any(size < 0 for _, shape, _ in listed for size in shape):
        raise too_large(declared, source, " of samples")
    kinds = (*_NUMERIC, "struct", "char")
    names = [name for name, _, kind in listed if kind in kinds and not name.startswith("__")]
    harmless = (*kinds, "cell", "sparse")
    foreign = ", ".join(f"{name} ({kind})" for name, _, kind in listed if kind not in harmless)
    if not names and foreign:
        message = f"holds only objects, which are never built: {foreign}"
        remedy = "save the signals as numeric arrays, or timetables as struct of arrays"
        raise InputRejected("X07", message, source, remedy)
    if not names:
        remedy = "save the signals as numeric arrays"
        raise InputRejected("S12", "no numeric variable", source, remedy)
    return names


def read_hdf5(path: Path, source: str) -> dict[str, Any]:
    """Return the numbers of a MAT file of version 7.3, or of any plain HDF5 file, and attributes.

    Raises:
        InputRejected: F08 damaged, X01 external link, X02 external storage, X03 virtual data,
            X04 too many members, X05 too large.
    """
    import h5py

    try:
        with h5py.File(path, "r", locking=False) as file:
            members = dict(_members(file, "", source))
            sets = {name: m for name, m in members.items() if isinstance(m, h5py.Dataset)}
            usable = {k: _is_usable(dataset, k, source) for k, dataset in sets.items()}
            declared = sum(dataset.nbytes for k, dataset in sets.items() if usable[k])
            if declared > ARRAYS.most_bytes(path.stat().st_size):
                raise too_large(declared, source, " of samples")
            found: dict[str, Any] = {}
            for name, member in members.items():
                if name not in sets:
                    found[name] = member  # an attribute
                elif usable[name]:
                    found |= _arrays(name, member)
            return found
    except InputRejected:
        raise
    except (*_BAD_MAT, UnicodeError):
        raise damaged_mat(source) from None


def _members(group: Any, prefix: str, source: str) -> Iterator[tuple[str, Any]]:
    """Yield data sets and attributes (numbers, texts) in and below a group by their path."""
    import h5py

    if "MATLAB_class" not in group.attrs:
        for key, value in list(group.attrs.items())[: ARRAYS.most_members]:
            text = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
            if isinstance(text, str | np.generic):
                yield f"{prefix}{key}", np.array(str(text))
    for count, name in enumerate(group):
        if count > ARRAYS.most_members:
            message = f"more than {ARRAYS.most_members} members"
            raise InputRejected("X04", message, source, "save the signals alone")
        link = group.get(name, getlink=True)
        if isinstance(link, h5py.ExternalLink):
            raise _stored_elsewhere("X01", f"external link '{prefix}{name}' refused", source)
        if name in ("#refs#", "#subsystem#") or not isinstance(link, h5py.HardLink):
            continue
        kind = group.get(name, getclass=True)
        if kind is h5py.Group and prefix.count(".") < ARRAYS.deepest:
            yield from _members(group[name], f"{prefix}{name}.", source)
        elif kind is h5py.Dataset:
            yield f"{prefix}{name}", group[name]


def _stored_elsewhere(code: str, message: str, source: str) -> InputRejected:
    return InputRejected(code, message, where=source, remedy="store the data in the file itself")


def _is_usable(dataset: Any, name: str, source: str) -> bool:
    """X02, X03: return whether a data set holds plain numbers; no text, no references."""
    if dataset.id.get_create_plist().get_external_count() > 0:
        raise _stored_elsewhere("X02", f"'{name}' lies in another file: refused", source)
    if dataset.is_virtual:
        raise _stored_elsewhere("X03", f"'{name}' is virtual: refused", source)
    numbers = dataset.dtype.kind in "fiub" or dataset.dtype.names is not None
    plain = numbers and dataset.shape is not None and "MATLAB_empty" not in dataset.attrs
    closed = dataset.attrs.get("MATLAB_class", b"double") in _CLOSED
    sides = [side for side in dataset.shape or () if side > 1]
    return bool(plain and not closed and dataset.shape and not sides[2:])  # no pictures


def _arrays(name: str, dataset: Any) -> dict[str, Anything]:
    """Return the arrays of a data set: itself, or the fields of its records."""
    values = np.asarray(dataset[()])
    if dataset.dtype.names is not None:
        return dict(_fields(name, values))
    # MATLAB stores by columns: what HDF5 calls (n, samples) is a (samples, n) matrix.
    values = values.T if "MATLAB_class" in dataset.attrs else values
    unit = next((dataset.attrs[key] for key in ("unit", "units") if key in dataset.attrs), "")
    unit = unit.decode("utf-8", "replace") if isinstance(unit, bytes) else unit
    said = isinstance(unit, str) and 0 < len(unit) <= ARRAYS.longest_unit
    return {f"{name} [{unit}]" if said else name: values}


def _fields(name: str, records: Anything) -> Iterator[tuple[str, Anything]]:
    """Yield the fields of numbers of a table of records, those of inner records by their path."""
    for field in records.dtype.names or ():
        yield from _fields(f"{name}.{field}", records[field])
    if records.dtype.kind in "fiub":
        yield name, records
