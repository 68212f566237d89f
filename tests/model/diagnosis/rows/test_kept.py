"""Numbers of objects in keys: one each as long as it lives, none twice, and none kept for what is gone."""

from __future__ import annotations

import gc

from pipelines.model.diagnosis.rows.kept import Kept


class Thing:
    """Two of them are equal, and not the same."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Thing)

    __hash__ = None  # type: ignore[assignment]


def test_each_thing_has_a_number_of_its_own() -> None:
    store, one, other = Kept(), Thing(), Thing()
    assert store.number(one) == store.number(one) != store.number(other)


def test_what_is_gone_is_let_go_and_its_number_is_not_given_again() -> None:
    """A diagnosis asks with a new arm after every fit: thousands of them in a process that lives on."""
    store = Kept()
    seen = {store.number(Thing()) for _ in range(1000)}
    gc.collect()
    assert len(seen) == 1000
    assert store.number(Thing()) not in seen
    assert len(store._numbered) < 3
