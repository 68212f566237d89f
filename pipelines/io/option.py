"""Declare fields of dataclasses as options of the command line."""

from __future__ import annotations

import dataclasses
from typing import Any


def option(default: Any, text: str, *flags: str, **more: Any) -> Any:
    """Return a dataclass field that the command line offers as an option.

    Args:
        default: default of the field.
        text: help; the default in brackets at its end where `default` does not say it.
        flags: names on the command line, "--no-rest" of a field that is true by default,
            "--a/--no-a" for both; one without dashes is a positional argument. By default "--"
            and the field's name.
        more: metadata of the field.
    """
    return dataclasses.field(default=default, metadata={"help": text, "flags": flags, **more})
