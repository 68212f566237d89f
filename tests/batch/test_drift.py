"""What moved from item to item is told, and what only scattered is not."""

from __future__ import annotations

import json

import jsonschema
import numpy as np
import pytest

from pipelines.estimation.drift import Session, drift_of
from pipelines.io.results import result_schema
from pipelines.report.batch_report import Result
from tests.batch.conftest import Lay, obey
from tests.batch.records import STD, item_of


def _records(values: np.ndarray) -> list[Session]:
    """Items recorded one a day, in an order that is not that of their names."""
    order = np.random.default_rng(0).permutation(len(values))
    return [item_of(f"item {order[i]:03d}", figures={"p1": (float(value), STD, "kg m^2")}, robot="arm",
                    recorded=f"2026-01-{i + 1:02d}T00:00:00Z") for i, value in enumerate(values)]


def test_a_step_is_dated() -> None:
    """Six std in one item: that one has moved, by about as much, no other is blamed for it, and χ² says that something did."""
    values = 1.0 + STD * np.random.default_rng(2).normal(size=10)
    values[6] += 6.0 * STD
    course = drift_of(_records(values))[0].figures[0]
    records = _records(values)
    assert course.moved == (records[6].name,)
    assert 4.0 < course.away[6] < 8.0
    assert course.probability is not None
    assert course.probability < 1e-3
    assert course.items == tuple(record.name for record in records)  # by the time of recording, not by name


def test_robots_are_not_mixed() -> None:
    """Two arms differ by nature."""
    records = [item_of(f"{robot}{i}", figures={"p1": (value, STD, "kg m^2")}, robot=robot)
               for robot, value in (("a", 1.0), ("b", 2.0)) for i in range(3)]
    assert [(drift.robot, drift.figures[0].moved) for drift in drift_of(records)] == [("a", ()), ("b", ())]


def test_the_summary_table_holds_every_figure(lay: Lay) -> None:
    """summary.parquet, one row a figure, for whoever wants to plot it: with value, std, unit, and how far it is away."""
    import pyarrow.parquet as pq

    outcome = obey(lay({"a": "value 1 std 0.1 rms 0.3", "b": "value 2 std 0.1 rms 0.3", "c": "reject"}))
    rows = pq.read_table(outcome.folder / "summary.parquet").to_pylist()
    assert [(row["item"], row["status"], row["quantity"], row["value"], row["std"], row["unit"]) for row in rows] == [
        ("a", "ok", "p1", 1.0, 0.1, "kg m^2"), ("a", "ok", "torque rms joint 1", 0.3, None, "N m"),
        ("b", "ok", "p1", 2.0, 0.1, "kg m^2"), ("b", "ok", "torque rms joint 1", 0.3, None, "N m"),
        ("c", "rejected", None, None, None, None)]
    assert rows[0]["away"] == pytest.approx(-1.0 / np.sqrt(0.02))
    stored = json.loads((outcome.folder / "result.json").read_text())
    assert stored["counts"] == {"ok": 2, "found": 0, "rejected": 1, "failed": 0}
    jsonschema.validate(stored, result_schema(Result, "batch"))
