"""Read and write a log as HDF5: nothing is followed, and all is measured before it is read."""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pipelines.errors import InputRejected
from pipelines.io.config import FORMAT as LIMITS
from pipelines.io.sandbox import Answer
from pipelines.io.schema import FORMAT, FORMAT_VERSION, Array, plain

_HEAD, _GROUPS = ("format", "format_version"), ("controller", "derived")
_AGAIN = "copy the file again from where it was recorded"
_OPTIONS: dict[str, Any] = {
    "dtype": "<f8",
    "compression": "gzip",
    "compression_opts": 1,
    "shuffle": True,
    "fletcher32": True,
    "track_times": False,
}


def write(path: Path, parts: Answer) -> None:
    """Write the parts of a log, samples in chunks of (65536, 1) with gzip and fletcher32."""
    import h5py

    groups = dict(parts.about["groups"])
    head = {"format": FORMAT, "format_version": FORMAT_VERSION, "digest": parts.about["digest"]}
    with _written_to(path) as file:
        _write_attributes(file, head | groups.pop("attributes"))
        robot = groups.pop("robot")
        for name, attributes in groups.items():
            _write_attributes(file.create_group(name), attributes)
        file.create_dataset("robot", data=robot, dtype=h5py.string_dtype("utf-8"))
        signals = file.create_group("signals")
        for name, values in parts.arrays.items():
            how = {"dtype": "<f8", "track_times": False}  # what has no samples has no chunks
            if values.size:
                how = _OPTIONS | {"chunks": (min(LIMITS.chunk, len(values)), 1)[: values.ndim]}
            dataset = signals.create_dataset(name, data=values, **how)
            dataset.attrs.update(parts.about["signals"][name])


@contextlib.contextmanager
def _written_to(path: Path) -> Iterator[Any]:
    """Give an HDF5 file in memory, and write it to `path`.

    A full disk is then an error of Python; HDF5 itself cannot close a file without room, and
    crashes later. Version 1.10 of the format checksums metadata: a flipped bit there is noticed.
    """
    import h5py

    version = ("v110", "v110")
    with h5py.File("log", "w", libver=version, driver="core", backing_store=False) as file:
        yield file
        file.flush()
        image = file.id.get_file_image()
    path.write_bytes(image)


def _write_attributes(owner: Any, attributes: Mapping[str, Any]) -> None:
    import h5py

    text = h5py.string_dtype("utf-8")
    for name, value in attributes.items():
        if isinstance(value, tuple):
            owner.attrs.create(name, list(value), shape=(len(value),), dtype=text)
        elif isinstance(value, int):
            owner.attrs.create(name, value, dtype="<i8")
        elif isinstance(value, str):  # of variable length: the only one that may exceed 64 KiB
            owner.attrs.create(name, value, dtype=text)
        else:
            owner.attrs[name] = value


def write_series(path: Path, series: Mapping[str, Array]) -> None:
    """Write the series of a result, each under the place where its JSON names it."""
    with _written_to(path) as file:
        file.attrs["format"] = "rrrid-result"
        for name, values in series.items():
            rows = max(1, LIMITS.chunk * len(values) // max(values.size, 1))
            chunk = (min(rows, len(values)), *values.shape[1:])
            file.create_dataset(name, data=values, chunks=chunk, **_OPTIONS)


def read_series(path: Path) -> dict[str, Array]:
    """Return the series of a result; only numbers that lie in the file itself are read.

    Raises:
        InputRejected: F02-F04, damaged; X01-X05, S12, it leads elsewhere or holds something else.
    """
    import h5py

    found: dict[str, Any] = {}

    def note(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            _refuse_bad_dataset(item, f"{path}, /{name}")
            found[f"/{name}"] = item

    with _opened(path) as file:
        file.visititems(note)
        declared = sum(8 * math.prod(dataset.shape) for dataset in found.values())
        refuse_oversize(declared, path.stat().st_size, "X05", path)
        return {name: _reals(dataset, f"{path}, {name}") for name, dataset in found.items()}


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a file to read; an error of the library becomes InputRejected."""
    import h5py

    try:
        with h5py.File(path, "r", locking=False) as file:
            yield file
    except InputRejected:
        raise
    except (OSError, RuntimeError, KeyError, ValueError, TypeError, MemoryError) as problem:
        raise _explain(problem, path) from None


def read_parts(path: Path, only: Collection[str] | None = None) -> Answer:
    """Return the groups of attributes, the digest, and the signals of `only` or all.

    Runs in the guarded child.

    Raises:
        InputRejected: with the row of the table of bad inputs that fits.
    """
    where = str(path)
    with _opened(path) as file:
        head = {n: _attribute(file.attrs, n, where) for n in _HEAD if n in file.attrs}
        refuse_version(head, "HDF5", where)
        _check_members(file, ("robot", "signals", *_GROUPS), where)
        attributes = _attributes(file, where)
        digest = attributes.pop("digest", None)
        groups: dict[str, Any] = {
            "attributes": {n: attributes[n] for n in attributes if n not in _HEAD}
        }
        for name in _GROUPS:
            if name in file:
                groups[name] = _attributes(_group(file, name, ()), f"{where}, /{name}")
        if "robot" in file:
            groups["robot"] = _robot_text(file["robot"], where)
        signals = _group(file, "signals", file.get("signals", ()))
        for name in signals:
            _refuse_bad_dataset(signals[name], f"{where}, /signals/{name}")
        declared = sum(8 * math.prod(one.shape) for one in signals.values())
        refuse_oversize(declared, path.stat().st_size, "X05", where)
        words, arrays = {}, {}
        for name in signals:
            if only is None or name in only:
                place = f"{where}, /signals/{name}"
                words[name] = _attributes(signals[name], place)
                arrays[name] = _reals(signals[name], place)
        return Answer({"groups": groups, "digest": digest, "signals": words}, arrays)


def refuse_version(attributes: dict[str, Any], container: str, where: str) -> None:
    """Take format and version out of the attributes of a log; refuse others (F06, F11).

    Args:
        container: "HDF5" or "Parquet".
    """
    form, version = attributes.pop("format", None), attributes.pop("format_version", None)
    if form != FORMAT:
        words = f"{container}, but not an experiment log: its format is {form!r}"
        remedy = "use 'rrrid import' with a recipe to make a log of a recording"
        raise InputRejected("F06", words, where, remedy)
    if version != FORMAT_VERSION or not isinstance(version, int) or isinstance(version, bool):
        words = f"format_version {version}; this program understands version {FORMAT_VERSION}"
        raise InputRejected("F11", words, where, "update rrrid, or write the log in that version")


def _check_members(group: Any, known: Collection[str], where: str) -> None:
    """Refuse links before one is followed (X01, X04), and what the format does not name (S19).

    A group that it does not name is not looked into, however deep it is (X04).
    """
    import h5py

    if max(len(group), len(group.attrs)) > LIMITS.members:
        words = f"more than {LIMITS.members} members or attributes"
        raise InputRejected("X04", words, where, "a log holds robot, controller and signals")
    store = "store the data in the log itself"
    for name in group:
        link = group.get(name, getlink=True)
        if isinstance(link, h5py.ExternalLink):
            words = f"external link '{name}' -> '{link.filename}' refused"
            raise InputRejected("X01", words, where, store)
        if isinstance(link, h5py.SoftLink):
            raise InputRejected("X04", f"soft link '{name}' refused", where, store)
        if name not in known:
            is_group = group.get(name, getclass=True) is h5py.Group
            words = f"'{name}' is not in format version {FORMAT_VERSION}"
            words = f"group {words}, and not looked into" if is_group else words
            raise InputRejected("X04" if is_group else "S19", words, where, "remove it")


def _group(file: Any, name: str, known: Collection[str]) -> Any:
    """Return a group that holds nothing but `known`, and no links."""
    import h5py

    if file.get(name, getclass=True) is not h5py.Group:
        remedy = "a log has /robot and /signals"
        raise InputRejected("S01", f"group /{name} is missing", file.filename, remedy)
    _check_members(file[name], known, f"{file.filename}, /{name}")
    return file[name]


def _attributes(owner: Any, where: str) -> dict[str, Any]:
    attributes = owner.attrs  # made anew with each look
    return {name: _attribute(attributes, name, f"{where}, attribute {name}") for name in attributes}


def _attribute(attributes: Any, name: str, where: str) -> Any:
    """Return an attribute as JSON has it."""
    import h5py

    stored = attributes.get_id(name)
    declared = math.prod(stored.shape) * stored.dtype.itemsize
    if declared > LIMITS.attribute:
        remedy = "an attribute is a few words or numbers"
        raise InputRejected("X05", f"declares {declared} bytes", where, remedy)
    if h5py.check_string_dtype(stored.dtype) is None and stored.dtype.kind not in "SUfiu":
        words = f"of type {stored.dtype}, neither text nor number"
        raise InputRejected("S12", words, where, "write it as a text or a number")
    value = attributes[name]
    if isinstance(value, h5py.Empty):
        raise InputRejected("S20", "empty", where, "write its value, or leave it out")
    return plain(_text(value.tolist() if isinstance(value, np.generic | np.ndarray) else value))


def _text(value: Any) -> Any:
    if isinstance(value, list):
        return [_text(item) for item in value]
    return value.decode("utf-8") if isinstance(value, bytes) else value


def _robot_text(dataset: Any, where: str) -> str:
    import h5py

    scalar = isinstance(dataset, h5py.Dataset) and dataset.shape == ()
    if not scalar or h5py.check_string_dtype(dataset.dtype) is None or _foreign(dataset):
        remedy = "write the robot's TOML as a single text"
        raise InputRejected("S20", "/robot is not a scalar text", where, remedy)
    return str(dataset.asstr()[()])


def _foreign(dataset: Any) -> str:
    """Say what reads other files, or zeros where those are missing (X02, X03); "" for none."""
    if dataset.id.get_create_plist().get_external_count() > 0:
        return "external raw storage"
    return "virtual data" if dataset.is_virtual else ""


def _refuse_bad_dataset(dataset: Any, where: str) -> None:
    """Refuse what is no array of real numbers in this very file, before one byte is read."""
    import h5py

    if not isinstance(dataset, h5py.Dataset):
        raise InputRejected("S19", "not a data set", where, "a signal is one data set")
    if foreign := _foreign(dataset):
        code, remedy = "X02" if "raw" in foreign else "X03", "store the data in the log itself"
        raise InputRejected(code, f"{foreign} refused", where, remedy)
    kind = dataset.dtype
    if kind.kind not in "fiu" or kind.itemsize > np.dtype(float).itemsize or dataset.ndim < 1:
        words = f"type {kind} of shape {dataset.shape}, not real numbers over samples"
        raise InputRejected("S12", words, where, "store float64 of shape (samples, joints)")
    properties = dataset.id.get_create_plist()
    for index in range(properties.get_nfilters()):
        code, _, _, name = properties.get_filter(index)
        if not h5py.h5z.filter_avail(code):
            label = name.decode("utf-8", "replace") if name else "unnamed"
            words = f"needs the HDF5 filter {code} ({label}), which is not installed"
            remedy = "install its plug-in (pip install hdf5plugin covers most), or write with gzip"
            raise InputRejected("F10", words, where, remedy)


def refuse_oversize(declared: int, size: int, code: str, where: object) -> None:
    """Refuse `declared` bytes of samples that a file of `size` bytes cannot honestly hold."""
    usual = max(LIMITS.always, LIMITS.packing * size)
    if declared > min(usual, max(LIMITS.long, LIMITS.long_packing * size)):
        words = f"declares {declared / 1e6:.0f} MB in a file of {size / 1e6:.3f} MB"
        remedy = "this is not a recording; if it is, store it uncompressed"
        raise InputRejected(code, words, where, remedy)


def _reals(dataset: Any, where: str) -> Array:
    """Return a data set as float64."""
    try:
        stored = dataset[()]
    except OSError as problem:
        code, words = "F02", f"the data cannot be read: {problem}"
        if "filter" in str(problem) or "etcher" in str(problem):
            code, words = "F04", "checksum mismatch, the data are damaged"
        raise InputRejected(code, words, where, _AGAIN) from None
    whole = stored.dtype.kind in "iu" and stored.size
    if whole and max(abs(int(stored.max())), abs(int(stored.min()))) > LIMITS.integer:
        words, remedy = "integers beyond 2^53, which are no samples", "store float64"
        raise InputRejected("S12", words, where, remedy)
    return np.asarray(stored, dtype=np.float64)


def _explain(problem: BaseException, path: Path) -> InputRejected:
    """Return the library's message in the words of the table of bad inputs."""
    text = str(problem)
    code, words, remedy = "F02", f"damaged: {text or type(problem).__name__}", _AGAIN
    if found := re.search(r"eof = (\d+).*stored_eof = (\d+)", text):
        words = f"truncated: {found[1]} of {found[2]} bytes"
    elif "h5clear" in text or "already open for write" in text or "object header" in text:
        code, words = "F03", "not closed properly by the program that wrote it"
        remedy = "try 'h5clear -s FILE', or record again"
    elif isinstance(problem, MemoryError):
        raise problem
    return InputRejected(code, words, path, remedy)
