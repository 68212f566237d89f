"""Make a new log of a log and what was derived from it, and find the recording inside a derived log again.

    richer = derive(log, "reconstruct", settings, {"q_hat": ...})
    fits   = derived_by(log, "reconstruct", settings)       may its derived signals be used?
    bare   = recording(richer)                              equal to `log`, attribute for attribute

`source_sha256` is the digest of the recording, not of its file: a derived log fits its recording in either container.
What a recording said of itself under /derived (an import that resampled it, say) is kept in the settings.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

from pipelines.io import schema
from pipelines.io.canonical import digest_of
from pipelines.io.experiment import Array, Derived, ExperimentLog, Signal

__all__ = ["created", "derive", "derived_by", "recording"]

_STEPS = "steps"  # every command that derived something, first to last, with its settings
_BEFORE = "recording"  # what /derived held before rrrid derived anything from the recording
_OWN = "own"  # derived signals that the recording had already; a log without it had none
_DERIVING = ("reconstruct", "estimate-bps", "validate-writing", "diagnose", "extend")


def created(recorded: str | None = None) -> str:
    """Time stamp of a derived log. Equal inputs give equal logs: not the clock on the wall, but the time of the recording,
    or the one that reproducible builds agree on."""
    if recorded is not None:
        return recorded
    return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(int(os.environ.get("SOURCE_DATE_EPOCH", "0"))))


def derive(log: ExperimentLog, command: str, settings: Mapping[str, Any], signals: Mapping[str, Array]) -> ExperimentLog:
    """`log` with further `signals` (names of `schema.DERIVED`) that `command` derived with `settings`."""
    bare = recording(log)
    bare = replace(bare, signals={name: signal for name, signal in bare.signals.items() if name not in signals})
    own = [name for name in bare.signals if name in schema.DERIVED]
    steps = {name: done for name, done in _steps(log).items() if name != command} | {command: dict(settings)}
    record: dict[str, Any] = {_STEPS: steps, _BEFORE: asdict(bare.derived) if bare.derived else None, _OWN: own}
    new = {name: Signal(values, schema.unit_of(name), schema.DERIVED[name][1]) for name, values in signals.items()}
    about = Derived(command, json.dumps(record, sort_keys=True), digest_of(bare), created(log.recorded))
    return replace(log, signals={**log.signals, **new}, derived=about)


def derived_by(log: ExperimentLog, command: str, settings: Mapping[str, Any]) -> bool:
    """Return whether `log` holds what `command` with `settings` derives from the very recording it holds."""
    done = _steps(log).get(command)
    return (done is not None and done == json.loads(json.dumps(dict(settings))) and log.derived is not None
            and log.derived.source_sha256 == digest_of(recording(log)))


def recording(log: ExperimentLog) -> ExperimentLog:
    """`log` without what rrrid derived from it."""
    if log.derived is None or log.derived.command not in _DERIVING:
        return log
    before, own = (_record(log).get(key) for key in (_BEFORE, _OWN))
    names = own if isinstance(own, list) else []
    kept = {name: signal for name, signal in log.signals.items() if name not in schema.DERIVED or name in names}
    return replace(log, signals=kept, derived=Derived(**before) if isinstance(before, dict) else None)


def _steps(log: ExperimentLog) -> dict[str, Any]:
    if log.derived is None or log.derived.command not in _DERIVING:
        return {}
    steps = _record(log).get(_STEPS)
    return steps if isinstance(steps, dict) else {}


def _record(log: ExperimentLog) -> dict[str, Any]:
    """The settings under /derived; another program's need not be ours."""
    try:
        found = json.loads(log.derived.settings) if log.derived else {}
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}
