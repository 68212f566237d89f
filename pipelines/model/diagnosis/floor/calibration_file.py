"""calibration.json, and calibration.h5 beside it for its long series: thresholds stored by one diagnosis for the next.

    write_calibration(folder, made)
    made = read_calibration(path)          of a folder that diagnose or run has left, or of the file
"""

from __future__ import annotations

import json
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any, Final

import numpy as np

from pipelines.errors import InputRejected, UsageError
from pipelines.log.atomic import write_file
from pipelines.log.files import hash_file, regular_file
from pipelines.log.result_schema import object_schema
from pipelines.log.results import decode, encode, json_text, read_foreign_series, write_series
from pipelines.log.stored_result import listed_outputs
from pipelines.log.text import read_small_text
from pipelines.model.diagnosis.floor.calibration import FORMAT, FORMAT_VERSION, Calibration
from pipelines.model.diagnosis.floor.wide import Wide, WideCause

__all__ = ["calibration_files", "calibration_schema", "read_calibration", "write_calibration"]

_NAME, _SERIES = "calibration.json", "calibration.h5"
_LARGEST: Final = 16 << 20  # [B]
_AGAIN = "diagnose the logs of an arm in order again"


def calibration_schema() -> dict[str, Any]:
    """The JSON Schema of calibration.json; what files lack that are older than it, they are read without."""
    schema = object_schema(Calibration, "calibration.json of rrrid diagnose")
    for kind, told in ((Calibration, schema), *((kind, schema["$defs"][kind.__name__]) for kind in (Wide, WideCause))):
        later = {one.name for one in fields(kind) if one.default is not MISSING and not one.kw_only}
        told["required"] = [name for name in told["required"] if name not in later]
    return schema


def write_calibration(folder: Path, made: Calibration) -> None:
    object_, series = encode(made)
    write_file(folder / _NAME, lambda draft: _put(draft, json_text(object_)))
    if series:
        write_file(folder / _SERIES, lambda draft: write_series(draft, series))


def _put(draft: Path, text: str) -> None:
    draft.write_text(text, encoding="utf-8")


def calibration_files(path: Path) -> tuple[Path, ...]:
    """The files of the calibration at `path`; of a run's folder those that its diagnosis has left.

    Raises:
        UsageError: C04, there is none.
    """
    file = path
    if path.is_dir():
        file = next((one for one in (path / _NAME, path / "diagnose" / _NAME) if one.is_file()), path / _NAME)
    if not file.is_file():
        raise UsageError("C04", "no calibration.json there", where=path, remedy="name the folder that diagnose has left with --out")
    return tuple(one for one in (file, file.with_name(_SERIES)) if one.is_file())


def read_calibration(path: Path) -> Calibration:
    """The calibration at `path`.

    Raises:
        UsageError: C04, there is none.
        InputRejected: F05, it is not what provenance.json says; F11, of a later version; S19, it is no calibration.
    """
    files = calibration_files(path)
    for file in files:
        regular_file(file, what="a calibration.json, or the folder it is in")
        expected = listed_outputs(file.parent).get(file.name)
        if expected is not None and expected != hash_file(file):
            raise InputRejected("F05", "sha256 differs from provenance.json: it was changed since it was written", where=file,
                                remedy=_AGAIN)
    try:
        object_ = json.loads(read_small_text(files[0], _LARGEST, what="a calibration.json"))
    except (ValueError, RecursionError):
        raise _strange(files[0], "it is not complete JSON") from None
    if not isinstance(object_, dict) or object_.get("format") != FORMAT:
        raise _strange(files[0], f"its \"format\" is not \"{FORMAT}\"")
    version = object_.get("format_version")
    if isinstance(version, int) and version > FORMAT_VERSION:
        raise InputRejected("F11", f"format version {version}; this program understands up to {FORMAT_VERSION}", where=files[0],
                            remedy="update rrrid")
    series = read_foreign_series(files[1]) if len(files) > 1 else {}
    try:
        made = decode(Calibration, object_, series)
        fault = _fault(made)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as problem:
        raise _strange(files[0], f"{type(problem).__name__} {problem}") from None
    if fault:
        raise _strange(files[0], fault)
    return made


def _strange(file: Path, why: str) -> InputRejected:
    return InputRejected("S19", f"not a calibration of rrrid: {why}", where=file, remedy=_AGAIN)


def _fault(made: Calibration) -> str:
    """What does not go together, in words."""
    joints = len(made.weight)
    arrays = [made.floor, made.noise, *(getattr(made.conditions, name) for name in ("rows", "speed", "acceleration", "span"))]
    if joints < 1 or any(one.shape != (joints,) for one in arrays):
        return "arrays of different numbers of joints"
    if not (np.isfinite(made.weight).all() and (made.weight > 0.0).all() and (made.conditions.rows > 0.0).all()):
        return "weights or rows that are no positive numbers"
    stored = made.origin.kind == "reference logs"
    places = (None, *range(1, joints + 1))
    if not all(one.own >= 0.0 and (stored or one.gain >= 0.0) and one.joint in places for one in made.causes):
        return "a threshold that is no number, or of a joint that is not there"
    if not (np.isfinite(arrays[0]).all() and all(np.isfinite(one).all() for one in arrays[2:])
            and made.conditions.row_time > 0.0):
        return "a floor, or conditions, that are no numbers"  # the noise of the drives is unknown without a twin
    if made.following is not None and not (made.following.shape == (joints,) and (made.following >= 0.0).all()):
        return "how far an arm in order follows its motion, that is no number or of other joints"
    if made.wander is not None and not (made.wander.shape == (joints,) and (made.wander >= 0.0).all()):
        return "a wander of the drives that is no number or of other joints"
    if made.wide is None:
        return "" if stored else "causes of the whole arm are missing"
    return _fault_of_sums(made.wide, joints, sum(one.joint is None for one in made.causes))


def _fault_of_sums(wide: Wide, joints: int, count: int) -> str:
    """Of `count` causes of the whole arm, and others that act on several joints."""
    rank, replicas = wide.model.shape[1], wide.left.shape[2]
    whole = [one.joint is None for one in wide.causes]
    fits = (whole == sorted(whole, reverse=True) and sum(whole) == count
            and wide.model.shape == (joints, rank, rank) and wide.left.shape == (joints, rank, replicas)
            and wide.weight.shape == wide.usual.shape == wide.rest.shape == (joints,))
    for one in wide.causes:
        shapes, k = one.columns.shape[1:3]
        fits = fits and (one.columns.shape == (joints, shapes, k, k) and one.model.shape == (joints, shapes, k, rank)
                         and one.left.shape == (joints, shapes, k, replicas) and one.joint in (None, *range(1, joints + 1)))
    if not fits:
        return "sums of causes on several joints that do not go together"
    # Of a cause without numbers no gain exceeds its threshold: it would be found nowhere, and nobody told.
    sums = [wide.model, wide.left, wide.usual, wide.rest, *(x for one in wide.causes for x in (one.columns, one.model, one.left))]
    finite = all(np.isfinite(x).all() for x in sums) and bool((np.isfinite(wide.weight) & (wide.weight > 0.0)).all())
    return "" if finite and 0.0 < wide.longer < np.inf else "sums of causes on several joints that are no numbers"
