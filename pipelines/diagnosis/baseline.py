"""Compute the screening statistic and residual between parts of logs in which nothing has changed.

One family-wise error holds for all candidates. Where nothing has changed, T_c exceeds the χ² bound
because every model has errors; unlike noise, these grow with the number of rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pipelines.diagnosis.candidates import Dictionary, Group
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.dataset import Dataset
from pipelines.diagnosis.prior import Prior
from pipelines.diagnosis.screening import Screened, best_of, screen
from pipelines.estimation.bootstrap import chi2_bound, upper_point
from pipelines.estimation.joint_table import Array, Arrow, Structure, Table

__all__ = ["Baseline", "Parts", "Sums", "baseline"]

Sums = tuple[Array, tuple[Array, ...]]  # B Cᵀ, and C Cᵀ of each group

_SPLITS = 6  # numerics: of the reference into two
_HALF = 0.5  # numerics: of a fault's power, what a family explains that is like its own
_RIDGE = 1e-9  # numerics: of unit nominal columns, which may be dependent


@dataclass(frozen=True)
class Baseline:
    """Screening and residual of what is usual on a machine, from splits of its known logs."""

    alpha: float
    families: int  # causes at joints, that are compared at once
    bias: dict[str, float]  # of each family, a row: what T_c exceeds its χ² bound by
    worst_fit: float  # cost of a row, that a healthy session exceeds rarely
    usual_fit: float

    def threshold(self, group: Group, freedom: int, rows: int) -> float:
        """Return the T_c that a healthy machine exceeds with probability `alpha` in all."""
        return chi2_bound(self.alpha / self.families, freedom) + rows * self.bias[group.family]


def baseline(
    parts: Parts, dataset: Dataset, dictionary: Dictionary, config: DiagnosisConfig
) -> Baseline:
    """Return what screening and residual are between parts of the reference."""
    families = len({group.key for group in dictionary.groups})
    excess: dict[str, list[float]] = {}
    largest: dict[str, Screened] = {}
    fits: list[float] = []
    for before, after in _splits(len(parts.counts)):
        found, fit, rows = parts.compared(before, list(after))
        fits.append(fit)
        for one in best_of(found).values():
            family = one.group.family
            if family not in largest or one.gain > largest[family].gain:
                largest[family] = one
            bound = chi2_bound(config.alpha / families, one.freedom)
            excess.setdefault(family, []).append((one.gain - bound) / rows)
    bias = {name: max(0.0, upper_point(values, config.alpha)) for name, values in excess.items()}
    if dataset.reference is None:
        bias = _unlike(bias, largest, parts, dictionary.known)
    return Baseline(
        config.alpha, families, bias, upper_point(fits, config.alpha), float(np.median(fits))
    )


def _unlike(
    bias: dict[str, float], best: dict[str, Screened], parts: Parts, candidates: Table
) -> dict[str, float]:
    """Return each family's bias, at most the largest of those that are not like it.

    Without reference logs a fault is part of what its own family leaves, and of what those leave
    that imitate more than half of it beside the nominal columns.

    Args:
        best: of each family, what explains most of a part.
    """
    columns = np.concatenate([one.group.columns for one in best.values()])
    n, table = parts.prior.n_nominal, candidates.take(columns)
    nominal = Arrow.of(
        np.sum(parts.prior.grams, axis=0)[:n, :n] + _RIDGE * np.eye(n),
        Structure.all_shared(n, len(parts.prior.structure.own)),
    )
    half = nominal.half(parts.cross[:, :n, columns].sum(axis=0))
    gram = table.gram(table) - half.T @ half
    ends = np.cumsum([one.group.width for one in best.values()])
    place = {f: slice(e - o.group.width, e) for (f, o), e in zip(best.items(), ends, strict=True)}

    def imitated(family: str, other: str) -> float:
        own, its = place[family], place[other]
        power = float(best[family].amplitudes @ gram[own, own] @ best[family].amplitudes)
        if power <= 0.0:  # nominal columns imitate all of it
            return 1.0
        across = gram[its, own] @ best[family].amplitudes
        return float(across @ np.linalg.pinv(gram[its, its], 1e-6, True) @ across / power)

    return {
        family: min(
            value, max((bias[o] for o in best if imitated(family, o) < _HALF), default=value)
        )
        for family, value in bias.items()
    }


@dataclass(frozen=True, eq=False)
class Parts:
    """Products of the columns over each part of the reference, in units of the noise."""

    prior: Prior
    groups: tuple[Group, ...]
    cross: Array  # (parts, k, columns) B Cᵀ
    moments: Array  # (parts, columns) C y
    squares: list[tuple[Array, ...]]  # of each part, C Cᵀ of each group
    powers: Array  # (parts,) yᵀy
    counts: Array  # (parts,) rows

    @classmethod
    def of(cls, dataset: Dataset, dictionary: Dictionary, prior: Prior) -> Parts:
        rows, y, parts = dataset.known, dataset.known.y, prior.parts
        candidates = dictionary.known
        base, spans = prior.table(rows.nominal, candidates), [g.span for g in dictionary.groups]
        return cls(
            prior,
            dictionary.groups,
            np.array([base.gram(candidates, part) for part in parts]),
            np.array([candidates.moments(y, part) for part in parts]),
            [candidates.squares(spans, part) for part in parts],
            np.array(
                [sum(float(v[m] @ v[m]) for v, m in zip(y, part, strict=True)) for part in parts]
            ),
            np.array([sum(int(m.sum()) for m in part) for part in parts], dtype=np.float64),
        )

    def sums(self, parts: Sequence[int]) -> Sums:
        """Return B Cᵀ (k, columns), and C Cᵀ of each group, over some parts together."""
        each = zip(*(self.squares[k] for k in parts), strict=True)
        return self.cross[list(parts)].sum(axis=0), tuple(np.sum(own, axis=0) for own in each)

    def compared(
        self, before: tuple[int, ...], after: list[int]
    ) -> tuple[list[Screened], float, float]:
        """Return candidates, cost a row (`State.cost`) and rows of some parts after others."""
        info, expected = self.prior.of(before)
        moment = info @ expected
        gram = np.sum([self.prior.grams[k] for k in after], axis=0)
        own = np.sum([self.prior.moments[k] for k in after], axis=0)
        known = Arrow.of(info + gram, self.prior.structure)
        mean = known.solve(moment + own)
        (cross, squares), rows = self.sums(after), float(self.counts[after].sum())
        left = self.moments[after].sum(axis=0) - cross.T @ mean
        found = screen(self.groups, known, cross, squares, left)
        cost = self.powers[after].sum() - (moment + own) @ mean
        cost += expected @ moment
        return found, float(cost) / rows, rows


def _splits(parts: int) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Return splits of the parts into two, half of them each, spread evenly over all splits."""
    every = list(combinations(range(parts), parts // 2))
    halves = every[:: max(1, len(every) // _SPLITS)][:_SPLITS]
    return [(half, tuple(k for k in range(parts) if k not in half)) for half in halves]
