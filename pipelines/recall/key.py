"""All that a stage's result depends on, as one hash; and in words, what of it has changed since."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

__all__ = ["Key", "changes", "digest_of_json"]

_NAMED = 3  # of many, in words


def digest_of_json(value: Any) -> str:
    """SHA-256 of `value` as JSON, whatever the order of its keys."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, ensure_ascii=True).encode()).hexdigest()


@dataclass(frozen=True)
class Key:
    """Of one stage: everything that goes in, as plain JSON.

    `logs` are those the stage looks at, name -> SHA-256 of the file; of the `others` only what they say of themselves.
    `through` are the stages that the logs have come through, `upon` the one whose result it builds on, `beside` the files that
    its settings name, name -> SHA-256.
    """

    stage: str
    settings: Mapping[str, Any]
    logs: Mapping[str, str]
    others: tuple[str, ...]
    unusable: Mapping[str, str]
    options: Mapping[str, Any]
    code: Mapping[str, str]
    libraries: Mapping[str, str]
    schema: str
    through: Mapping[str, str]
    upon: Mapping[str, str]
    beside: Mapping[str, str] = field(default_factory=dict)

    @property
    def parts(self) -> dict[str, Any]:
        """As it is stored. Logs keep their order: it is that of the result."""
        parts = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return parts | {"logs": [list(pair) for pair in self.logs.items()], "others": list(self.others)}

    @property
    def digest(self) -> str:
        return digest_of_json(self.parts)

    @property
    def treatment(self) -> str:
        """What is done to any log, whatever log it is."""
        return digest_of_json([self.settings, self.options, self.code, self.libraries, self.schema])


def changes(old: Mapping[str, Any], key: Key) -> str:
    """What of `key` is another than in the stored `old` parts, in words; "" where nothing is."""
    return "; ".join(_changes(old, key))


def _changes(old: Mapping[str, Any], key: Key) -> Iterator[str]:
    logs = dict(old.get("logs", []))
    yield from _told("log", logs, key.logs, lambda name: f"{name} has other content")
    if not _differ(logs, key.logs) and list(logs) != list(key.logs):
        yield "the logs are in another order"
    if list(old.get("others", [])) != list(key.others):
        yield "there are other logs beside those it reads"
    yield from _told("unusable file", old.get("unusable", {}), key.unusable, lambda name: f"{name} is unusable in another way")
    yield from _told("file", old.get("beside", {}), key.beside, lambda name: f"{name} has other content")
    for part in ("settings", "options"):
        before, now = old.get(part, {}), getattr(key, part)
        for name in _differ(before, now):
            yield f"{name} was {_value(before.get(name))}, is {_value(now.get(name))}"
    for part in ("through", "upon"):
        if differing := _differ(old.get(part, {}), getattr(key, part)):
            yield f"{_few([name for name in differing if name in getattr(key, part)] or differing)} before it changed"
    if differing := _differ(old.get("code", {}), key.code):
        yield f"code of {_few([name.removeprefix('pipelines.') for name in differing])}"
    before = old.get("libraries", {})
    for name in _differ(before, key.libraries):
        yield f"{name} {before.get(name, 'missing')} is now {key.libraries.get(name, 'missing')}"
    if old.get("schema") != key.schema:
        yield f"format {old.get('schema')} is now {key.schema}"


def _told(what: str, old: Mapping[str, str], new: Mapping[str, str], altered: Any) -> Iterator[str]:
    """What came, what went, and what is another."""
    if came := [name for name in new if name not in old]:
        yield f"new {what}{'s' if len(came) > 1 else ''} {_few(came)}"
    if went := [name for name in old if name not in new]:
        yield f"{what}{'s' if len(went) > 1 else ''} gone: {_few(went)}"
    if other := [name for name in new if name in old and old[name] != new[name]]:
        yield altered(_few(other))


def _differ(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    return [name for name in sorted({*old, *new}) if old.get(name, ...) != new.get(name, ...)]


def _few(names: list[str]) -> str:
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more


def _value(value: Any) -> str:
    text = "unset" if value is None else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 40 else f"{text[:39]}…"
