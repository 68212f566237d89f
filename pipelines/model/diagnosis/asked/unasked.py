"""What a diagnosis says unasked: of causes without a size to tell, and of friction laws that gave way to plainer ones."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FewerTerms", "WithoutLimit"]


@dataclass(frozen=True)
class WithoutLimit:
    """A cause that was looked for, or is none, and of which no size is to tell."""

    cause: str
    reason: str  # what was seen of it


@dataclass(frozen=True)
class FewerTerms:
    """A friction law that was asked for, and has more terms than these logs tell apart."""

    joint: int | None
    law: str  # as asked for
    taken: tuple[str, ...]  # in its place: the same law with fewer terms
    reason: str
