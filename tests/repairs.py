"""Every fault of a recording that `import` mends, each made from the good one, and what must be said of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.importers.good import RECIPE, good, lines, text, write

ANY = RECIPE.replace('"*.csv"', '["*.csv", "*.mat"]') + "[missing]\nvalues = [-999]\n"


@dataclass(frozen=True)
class Repair:
    """One row of the table: how to make it, and the finding that must come of it."""

    row: str  # code, and what tells cases of one code apart
    spoil: Callable[[Path], object]  # changes the folder that holds run.csv
    level: str = "repair"
    recipe: str = ANY

    @property
    def code(self) -> str:
        return self.row[:3]


def spoiled(folder: Path, column: str, at: object, value: float) -> None:
    columns = good()
    columns[column][at] = value  # type: ignore[index]
    write(folder, text(columns))


def rows_changed(folder: Path, change: Callable[[list[str]], list[str]]) -> None:
    write(folder, "\n".join(change(lines())) + "\n")


def clock_set_back(folder: Path) -> None:
    columns = good()
    columns["t"][600:] -= 0.25
    write(folder, text(columns))


def split_files(folder: Path) -> str:
    """Positions in one file, torques in another, no time: as the TX40 was recorded."""
    columns = good()
    (folder / "run.csv").unlink()
    write(folder, text({k: v for k, v in columns.items() if k.startswith("q")}), "a_pos.csv")
    write(folder, text({k: v for k, v in columns.items() if k.startswith("tau")}), "a_tau.csv")
    recipe = RECIPE.replace('"*.csv"', '"{run}_pos.csv"\nname = "{run}"').replace('unit = "N m"',
                                                                                  'unit = "N m", file = "{run}_tau.csv"')
    return recipe.replace('column = "t"\nunit = "s"', "rate = 1000")


def lossy(folder: Path, *lost: tuple[int, int]) -> None:
    """The good recording without the samples of these ranges."""
    keep = np.ones(len(good()["t"]), dtype=bool)
    for start, stop in lost:
        keep[start:stop] = False
    write(folder, text({name: values[keep] for name, values in good().items()}))


def uneven(folder: Path) -> None:
    columns = good()
    wander = np.random.default_rng(1).uniform(-0.0002, 0.0002, len(columns["t"]))
    write(folder, text(columns | {"t": columns["t"] + wander}))


def turning(folder: Path) -> None:
    """Joint 1 turns through ±pi."""
    columns = good()
    write(folder, text(columns | {"q_1": np.mod(3.0 + 6.0 * columns["t"] + np.pi, 2 * np.pi) - np.pi}))


NO_CLOCK = RECIPE.replace('column = "t"\nunit = "s"', "rate = 1000")
EVEN = ANY + "[resample]\nrate = 500\n"

REPAIRS = (
    Repair("D01", lambda f: spoiled(f, "q_2", 77, np.nan)),
    Repair("D01 block", lambda f: spoiled(f, "tau_1", slice(300, 340), np.nan)),
    Repair("D03", lambda f: spoiled(f, "tau_2", slice(70, 73), -999.0)),
    Repair("D03 block", lambda f: spoiled(f, "tau_2", slice(700, 730), -999.0)),
    Repair("D06", lambda f: spoiled(f, "q_2", 600, 0.9), "warn"),
    Repair("D07", turning, "warn"),
    Repair("F06", lambda f: write(f, text(good()), "run.mat") and (f / "run.csv").unlink(), "warn"),
    Repair("F09", lambda f: write(f, text(good())[:-50])),
    Repair("F09 without a clock", lambda f: rows_changed(f, lambda r: [*r[:500], r[500][:20], *r[501:]]), recipe=NO_CLOCK),
    Repair("F16", lambda f: write(f, text(good()).replace(",", ";").replace(".", ",")), "warn"),
    Repair("T01", clock_set_back),
    Repair("T01 often", lambda f: stepping(f, 5)),
    Repair("T02", lambda f: rows_changed(f, lambda r: [*r[:50], r[49], *r[50:]])),
    Repair("T03", lambda f: lossy(f, (50, 52)), "warn"),
    Repair("T03 at the limit", lambda f: lossy(f, (500, 510)), "warn"),
    Repair("T04", lambda f: lossy(f, (50, 152))),
    Repair("T04 just", lambda f: lossy(f, (500, 511))),
    Repair("T04 in a periodic log", lambda f: lossy(f, (400, 600)), recipe=ANY.replace("[time]", "period = 0.5\n[time]")),
    Repair("T04 resampled", lambda f: lossy(f, (400, 600)), recipe=EVEN),
    Repair("T04 allowed by the recipe", lambda f: lossy(f, (400, 600)),
           recipe=ANY.replace('unit = "s"', 'unit = "s"\nlongest_gap = 1.0')),
    Repair("T05", uneven, "warn"),
    Repair("T05 resampled", uneven, "warn", EVEN),
    Repair("T05 bridged", lambda f: lossy(f, (50, 52)), "warn", EVEN),
)


def stepping(folder: Path, times: int) -> None:
    """A clock that is set back by 50 ms, `times` times."""
    columns = good()
    back = np.searchsorted(np.arange(1, times + 1) * 200, np.arange(len(columns["t"])), side="right")
    write(folder, text(columns | {"t": columns["t"] - 0.05 * back}))
