"""Move an earlier batch aside, as a whole, where this one would lose it: of another stage, or in a default folder of other data."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path

from pipelines.batch.folder import BatchFolder
from pipelines.batch.items import Item
from pipelines.batch.lock import LOCK, locked
from pipelines.errors import Check, RrridError, clean
from pipelines.io.atomic import environment_faults
from pipelines.io.earlier import beside, kept, of_other_data, replaced
from pipelines.io.files import hash_file
from pipelines.io.places import provenance_of, refuse_own_place, tilde

__all__ = ["make_way"]


def make_way(folder: BatchFolder, stage: str, root: Path, items: Iterable[Item], named: bool, force: bool) -> tuple[Check, ...]:
    """C05: what lies in the claimed `folder` is moved beside it where it is lost else; what was done is said.

    Args:
        root: of the logs: what was made anew in its old place, imported again say, is no other data.
        items: all of the batch, whatever shard of them is done.
        named: the user has chosen the folder; then a batch of the same stage is replaced, as asked.
        force: nothing is kept.

    Raises:
        EnvironmentFault: P08, a batch is at work there.
        UsageError: C05, what would be moved is the folder one is in.
    """
    out = folder.out
    with locked(out), environment_faults(out):
        about = folder.about()
        if not about:
            return ()
        earlier = clean(str(about.get("stage") or ""), 40)
        if about.get("stage") != stage:
            what, ending = f"the earlier batch of {earlier or 'another command'}", earlier or "earlier"
        elif not named and provenance_of(out).get("root") != tilde(str(root)) and of_other_data(
                _inputs(folder.ledger.folder), (_hash(log) for item in items for log in item.logs)):
            what, ending = f"the earlier batch of {earlier}, of other data,", ""
        else:
            return ()
        if force:
            return (replaced(out, what, forced=True),)
        refuse_own_place(out)
        aside = beside(out, ending)
        os.replace(out, aside)
        (aside / LOCK).unlink(missing_ok=True)
        out.mkdir(exist_ok=True)  # another batch may have claimed it meanwhile
    return (kept(out, what, aside),)


def _inputs(ledger: Path) -> dict[str, str]:
    """What the items of the earlier batch were of, as far as they were done: path -> SHA-256."""
    found: dict[str, str] = {}
    for path in ledger.glob("*.json"):
        try:
            found |= json.loads(path.read_text(encoding="utf-8"))["inputs"]
        except (OSError, ValueError, KeyError, TypeError):
            continue  # torn by a power cut
    return found


def _hash(log: Path) -> str:
    try:
        return hash_file(log)
    except RrridError:
        return ""  # the item will say why
