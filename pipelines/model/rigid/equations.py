"""The equations τ = Y(q, dq, ddq) p of a recorded motion, in blocks, as a fit takes them.

Kostić et al. 2004, eq. (12)-(14). The regressor of the whole motion never stands in memory.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pipelines.fit.equations import Block
from pipelines.model.rigid.body import Array, RigidBody
from pipelines.model.rigid.rrr import ACTING, RRR

__all__ = ["RigidEquations"]

_RRR_COLUMNS = tuple(np.array(columns, dtype=np.intp) for columns in ACTING)


@dataclass(frozen=True, eq=False)
class RigidEquations:
    """Iterate as often as needed; each block is overwritten by the next. The arrays may be memory maps."""

    body: RigidBody
    q: Array  # [rad] (samples, joints)
    dq: Array
    ddq: Array
    tau: Array  # [N m] (samples, joints)
    block: int = 6144  # samples at most: what is worked on then stays in the cache

    def __iter__(self) -> Iterator[Block]:
        count = max(1, -(-len(self.q) // self.block))
        size = -(-len(self.q) // count)  # all alike, for a short rest costs as many calls as a full block
        memory = np.empty((28, size))
        for first in range(0, len(self.q), size):
            part = slice(first, min(first + size, len(self.q)))
            q, dq, ddq, tau = (np.asarray(x[part], dtype=np.float64) for x in (self.q, self.dq, self.ddq, self.tau))
            if isinstance(self.body, RRR):
                rows = self.body.acting_rows(q, dq, ddq, memory[:, :len(q)])
                yield Block(15, _RRR_COLUMNS, rows, tuple(np.ascontiguousarray(tau.T)))
            else:
                yield Block.of(self.body.regressor(q, dq, ddq), tau)
