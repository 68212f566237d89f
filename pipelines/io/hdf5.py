"""Read and write a log as HDF5: nothing is followed, nothing is trusted, everything is measured before it is read."""

from __future__ import annotations

import math
from collections.abc import Collection
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from pipelines.errors import InputRejected
from pipelines.io import canonical, schema
from pipelines.io.chunks import store
from pipelines.io.experiment import Array, ExperimentLog, Signal

__all__ = ["as_reals", "explain", "foreign_storage", "read_parts", "refuse_oversize", "write"]

_GROUPS = ("controller", "derived")
_MANY_ATTRIBUTES = 64
_LONG_ATTRIBUTE = 1 << 20  # [B] a model.json in /controller is the longest a log carries
# A chunk of gzip cannot unpack to more than 1032 times its size, and `t` never repeats: no honest log comes near this.
_LARGEST_RATIO = 1100
_ALWAYS_ALLOWED = 64 << 20  # [B]
# Only a log in which nothing moves is packed to a three-hundredth, and nobody records a quarter of a gigabyte of that.
_LONG, _LONG_RATIO = 256 << 20, 300  # [B], and how many times the file
_CHUNK = 65536  # samples


def write(path: Path, log: ExperimentLog) -> None:
    """Write `log` to `path`, samples in chunks of (65536, 1) with gzip, shuffle and fletcher32."""
    import h5py

    # Version 1.10 of the file format checksums its metadata, so that a flipped bit there is noticed as well.
    with h5py.File(path, "w", libver=("v110", "v110"), track_order=False) as file:
        groups = canonical.attributes_of(log)
        _write_attributes(file, {"format": schema.FORMAT, "format_version": schema.FORMAT_VERSION,
                                 "digest": canonical.digest_of(log)} | groups.pop("attributes"))
        for name, attributes in groups.items():
            _write_attributes(file.create_group(name), attributes)
        file.create_dataset("robot", data=log.robot_text, dtype=h5py.string_dtype("utf-8"))
        signals = file.create_group("signals")
        for name, signal in log.signals.items():
            dataset = _write_samples(signals, name, signal.values)
            dataset.attrs["units"], dataset.attrs["long_name"] = signal.units, signal.long_name


def _write_samples(signals: Any, name: str, values: Array) -> Any:
    if values.size == 0:
        return signals.create_dataset(name, data=values, dtype="<f8", track_times=False)
    return store(signals, name, values, (min(_CHUNK, len(values)),) + (1,) * (values.ndim - 1))


def _write_attributes(owner: Any, attributes: dict[str, object]) -> None:
    import h5py

    for name, value in attributes.items():
        if isinstance(value, tuple):
            owner.attrs.create(name, list(value), shape=(len(value),), dtype=h5py.string_dtype("utf-8"))
        elif isinstance(value, int):
            owner.attrs.create(name, value, dtype="<i8")
        elif isinstance(value, str) and len(value) > 60_000:
            # An attribute message holds less than 64 KiB, but a variable-length text lives in a heap of its own.
            owner.attrs.create(name, value, dtype=h5py.string_dtype("utf-8"))
        else:
            owner.attrs[name] = value


def read_parts(path: Path, only: Collection[str] | None = None) -> tuple[ExperimentLog, str | None]:
    """The container as it is: the log, with the signals of `only` or all, and the digest it carries or None.

    Runs inside the guarded child.

    Raises:
        InputRejected: with the row of the table of bad inputs that fits.
    """
    import h5py

    try:
        with h5py.File(path, "r", locking=False) as file:
            return _read_file(file, str(path), only)
    except InputRejected:
        raise
    except (OSError, RuntimeError, KeyError, ValueError, TypeError, UnicodeError, MemoryError) as problem:
        raise explain(problem, path) from None


def _read_file(file: Any, where: str, only: Collection[str] | None) -> tuple[ExperimentLog, str | None]:
    # First what could lead elsewhere, then what the file says it is; only a log of this version is judged by its names.
    _refuse_links(file, where)
    _version(file, where)
    _only(file, ("robot", "signals", *_GROUPS), where)
    attributes = _attributes(file, where)
    digest = attributes.pop("digest", None)
    if digest is not None and not isinstance(digest, str):
        raise InputRejected("S20", "attribute 'digest' is not a text", where=where, remedy="write it as a text, or leave it out")
    groups: dict[str, object] = {"attributes": attributes}
    for name in _GROUPS:
        if name in file:
            _refuse_links(_group(file, name, where), f"{where}, /{name}")
            _only(file[name], (), f"{where}, /{name}")
            groups[name] = _attributes(file[name], f"{where}, /{name}")
    groups["robot"] = _robot_text(file, where)
    signals = _group(file, "signals", where)
    _refuse_links(signals, f"{where}, /signals")
    _few(signals, f"{where}, /signals")
    datasets = _within_budget(signals, Path(where).stat().st_size, where)
    read = {name: _signal(dataset, f"{where}, /signals/{name}") for name, dataset in datasets.items()
            if only is None or name in only}
    attributes.pop("format"), attributes.pop("format_version")
    return canonical.from_parts(groups, read, where=where), digest


def _version(file: Any, where: str) -> None:
    there = file.attrs
    form, version = (_attribute(there, name, f"{where}, attribute {name}") if name in there else None
                     for name in ("format", "format_version"))
    if form != schema.FORMAT:
        raise InputRejected("F06", f"an HDF5 file, but not an experiment log: its format is {form!r}", where=where,
                            remedy="use 'rrrid import' with a recipe to make a log of a recording")
    if not isinstance(version, int) or version != schema.FORMAT_VERSION:
        raise InputRejected("F11", f"format_version {version}; this program understands version {schema.FORMAT_VERSION}",
                            where=where,
                            remedy="update rrrid, or write the log in that version")


def _refuse_links(group: Any, where: str) -> None:
    """X01, X04: only hard links; a link elsewhere is refused before it is followed."""
    import h5py

    for name in islice(group, _MANY_ATTRIBUTES + 1):
        link = group.get(name, getlink=True)
        if isinstance(link, h5py.ExternalLink):
            raise InputRejected("X01", f"external link '{name}' -> '{link.filename}' refused", where=where,
                                remedy="store the data in the log itself")
        if isinstance(link, h5py.SoftLink):
            raise InputRejected("X04", f"soft link '{name}' refused", where=where, remedy="store the data in the log itself")


def _few(group: Any, where: str) -> None:
    """X04: no more members than were looked at."""
    if len(group) > _MANY_ATTRIBUTES:
        raise InputRejected("X04", f"more than {_MANY_ATTRIBUTES} members", where=where,
                            remedy="a log holds robot, controller and signals")


def _only(group: Any, known: tuple[str, ...], where: str) -> None:
    """S19: nothing but what the format names; X04, a group besides, however deep: it is not looked into."""
    import h5py

    _few(group, where)
    for name in group:
        if name not in known:
            if group.get(name, getclass=True) is h5py.Group:
                raise InputRejected("X04", f"group '{name}' is not in format version {schema.FORMAT_VERSION}, and not looked into",
                                    where=where, remedy="remove it")
            raise InputRejected("S19", f"'{name}' is not in format version {schema.FORMAT_VERSION}", where=where,
                                remedy="remove it")


def _group(file: Any, name: str, where: str) -> Any:
    import h5py

    if file.get(name, getclass=True) is not h5py.Group:
        raise InputRejected("S01", f"group /{name} is missing", where=where, remedy="a log has /robot and /signals")
    return file[name]


def _attributes(owner: Any, where: str) -> dict[str, object]:
    there = owner.attrs  # made anew with each look
    if len(there) > _MANY_ATTRIBUTES:
        raise InputRejected("X04", f"{len(there)} attributes", where=where, remedy="a log has fewer than twenty")
    return {name: _attribute(there, name, f"{where}, attribute {name}") for name in there}


def _attribute(there: Any, name: str, where: str) -> object:
    import h5py

    info = there.get_id(name)
    declared = math.prod(info.shape) * info.dtype.itemsize
    if declared > _LONG_ATTRIBUTE:
        raise InputRejected("X05", f"declares {declared} bytes", where=where, remedy="an attribute is a few words or numbers")
    kind = info.dtype
    if h5py.check_string_dtype(kind) is None and kind.kind not in "SUfiu":
        raise InputRejected("S12", f"of type {kind}, neither text nor number", where=where,
                            remedy="write it as a text or a number")
    value = there[name]
    if isinstance(value, h5py.Empty):
        raise InputRejected("S20", "empty", where=where, remedy="write its value, or leave it out")
    if isinstance(value, np.ndarray):
        value = value.tolist()
        return [_as_text(v) for v in value] if value and not isinstance(value[0], float | int | list) else value
    return _as_text(value.item() if isinstance(value, np.generic) else value)


def _as_text(value: object) -> object:
    return value.decode("utf-8") if isinstance(value, bytes) else value


def _robot_text(file: Any, where: str) -> str:
    import h5py

    if file.get("robot", getclass=True) is not h5py.Dataset:
        raise InputRejected("S01", "the robot description /robot is missing", where=where,
                            remedy="a log explains itself: write /robot")
    dataset = file["robot"]
    if dataset.shape != () or h5py.check_string_dtype(dataset.dtype) is None or foreign_storage(dataset):
        raise InputRejected("S20", "/robot is not a scalar text", where=where, remedy="write the robot's TOML as a single text")
    return str(dataset.asstr()[()])


def foreign_storage(dataset: Any) -> str | None:
    """X02, X03: external raw storage and virtual data sets read other files, or zeros where those are missing."""
    properties = dataset.id.get_create_plist()
    if properties.get_external_count() > 0:
        return "external raw storage"
    return "virtual data" if dataset.is_virtual else None


def _within_budget(signals: Any, file_size: int, where: str) -> dict[str, Any]:
    """The data sets by their names. X02-X06, S12: every one is judged by its declaration before one byte of it is read."""
    import h5py

    declared, found = 0, {}
    for name in signals:
        place = f"{where}, /signals/{name}"
        if signals.get(name, getclass=True) is not h5py.Dataset:
            raise InputRejected("S19", "not a data set", where=place, remedy="a signal is one data set")
        dataset = found[name] = signals[name]
        if foreign := foreign_storage(dataset):
            raise InputRejected("X02" if "raw" in foreign else "X03", f"{foreign} refused", where=place,
                                remedy="store the data in the log itself")
        if dataset.dtype.kind not in "fiu" or dataset.dtype.itemsize > 8 or dataset.ndim not in (1, 2):
            raise InputRejected("S12", f"type {dataset.dtype} of shape {dataset.shape}, not real numbers over samples", where=place,
                                remedy="store float64 of shape (samples, joints)")
        _filters_available(dataset, place)
        declared += 8 * math.prod(dataset.shape)
    refuse_oversize(declared, file_size, "X05", where)
    return found


def refuse_oversize(declared: int, file_size: int, code: str, where: str) -> None:
    """Raise unless a file of `file_size` bytes may honestly hold `declared` bytes of samples."""
    if declared > max(_ALWAYS_ALLOWED, _LARGEST_RATIO * file_size) or declared > max(_LONG, _LONG_RATIO * file_size):
        raise InputRejected(code, f"declares {declared / 1e6:.0f} MB in a file of {file_size / 1e6:.3f} MB", where=where,
                            remedy="this is not a recording; if it is, store it uncompressed")


def _filters_available(dataset: Any, where: str) -> None:
    import h5py

    properties = dataset.id.get_create_plist()
    for index in range(properties.get_nfilters()):
        code, _, _, name = properties.get_filter(index)
        if not h5py.h5z.filter_avail(code):
            label = name.decode("utf-8", "replace") if name else "unnamed"
            raise InputRejected("F10", f"needs the HDF5 filter {code} ({label}), which is not installed", where=where,
                                remedy="install its plug-in (pip install hdf5plugin covers most), or write the log with gzip")


def _signal(dataset: Any, where: str) -> Signal:
    attributes = _attributes(dataset, where)
    unknown = sorted(set(attributes) - {"units", "long_name"})
    if unknown:
        raise InputRejected("S19", f"attributes {unknown} are not in the format", where=where, remedy="remove them")
    try:
        stored = dataset[()]
    except OSError as problem:
        code, what = ("F04",
                      "checksum mismatch, the data are damaged") if "filter" in str(problem) or "etcher" in str(problem) else (
            "F02", f"the data cannot be read: {problem}")
        raise InputRejected(code, what, where=where, remedy="copy the file again from where it was recorded") from None
    return Signal(as_reals(stored, where), str(attributes.get("units", "")), str(attributes.get("long_name", "")))


def as_reals(stored: Any, where: str) -> Array:
    """Samples as float64; S12 where integers are too large for it to hold exactly."""
    if stored.dtype.kind in "iu" and stored.size and max(abs(int(stored.max())), abs(int(stored.min()))) > 2**53:
        raise InputRejected("S12", "integers beyond 2^53, which are no samples", where=where, remedy="store float64")
    return np.asarray(stored, dtype=np.float64)


def explain(problem: BaseException, path: Path) -> InputRejected:
    """The library's message in the words of the table of bad inputs."""
    import re

    text, again = str(problem), "copy the file again from where it was recorded"
    if found := re.search(r"eof = (\d+).*stored_eof = (\d+)", text):
        return InputRejected("F02", f"truncated: {found[1]} of {found[2]} bytes", where=path, remedy=again)
    if "h5clear" in text or "already open for write" in text or "object header" in text:
        return InputRejected("F03", "not closed properly by the program that wrote it", where=path,
                             remedy="try 'h5clear -s FILE', or record again")
    if isinstance(problem, MemoryError):
        return InputRejected("X05", "needs more memory than a log may", where=path, remedy="split the recording")
    return InputRejected("F02", f"damaged: {text or type(problem).__name__}", where=path, remedy=again)
