"""Accelerations of many RRR arms at once: a few large array operations instead of many small ones.

Everything in D(q), c(q, dq) and h(q) of Kostić et al. 2004, (A5), is linear in the sines and cosines of six angles

    q2, q3, S = q2 + q3, 2 q2, 2 S, 2 q2 + q3          after 2 c2 cS = cos(2 q2 + q3) + cos q3, and the like

so that one product of matrices gives every element for every replica. Replicas are the last axis throughout: rows of
neighbouring numbers are what NumPy works on fastest.
"""

from __future__ import annotations

import numpy as np

from pipelines.model.rigid.body import Array
from pipelines.model.rigid.rrr import RRR

__all__ = ["ManyRRR"]

_ANGLES = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 0.0], [2.0, 2.0], [2.0, 1.0]])  # of q2 and q3
_FEATURES = 13  # 1, six sines, six cosines
# Elements of D in the order 11 12 13 22 23 33; cofactor ij = D[a] D[b] - D[c] D[d], row by row.
_COFACTORS = np.array([
    [[3, 5], [4, 4]], [[2, 4], [1, 5]], [[1, 4], [2, 3]],
    [[2, 4], [1, 5]], [[0, 5], [2, 2]], [[1, 2], [0, 4]],
    [[1, 4], [2, 3]], [[1, 2], [0, 4]], [[0, 3], [1, 1]]])
_UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


class ManyRRR:
    """D(q) a = τ - c(q, dq) - h(q), solved for a, for every replica."""

    def __init__(self, body: RRR, p: Array, added: Array, replicas: int) -> None:
        """`p` (15,), or (replicas, 15); `added` (3, 3) [kg m^2] goes to D."""
        a2, g = body.robot.joints[1].a, -body.robot.gravity[2]
        offset = np.array([joint.offset for joint in body.robot.joints])[1:]
        self._own = np.ndim(p) == 2
        table = _tables(np.moveaxis(np.asarray(p, dtype=np.float64), -1, 0), a2, g, added)  # (rows, features[, replicas])
        self._table = np.ascontiguousarray(table)
        self._phase = (_ANGLES @ offset)[:, None]
        self._angles = np.empty((6, replicas))
        self._features = np.ones((_FEATURES, replicas))
        self._elements = np.empty((len(table), replicas))
        self._products = np.ones((7, replicas))
        self._work = np.empty((3, 7, replicas))
        self._cofactors = np.empty((9, replicas))
        self._other = np.empty((9, replicas))
        self._sum = np.empty((3, replicas))
        self._determinant = np.empty(replicas)

    def bias_and_cofactors(self, q: Array, dq: Array) -> tuple[Array, Array, Array]:
        """c + h (3, replicas), the cofactors of D (3, 3, replicas) and its determinant (replicas,). Working memory."""
        features, elements, products = self._features, self._elements, self._products
        np.matmul(_ANGLES, q[1:], out=self._angles)
        np.add(self._angles, self._phase, out=self._angles)
        np.sin(self._angles, out=features[1:7])
        np.cos(self._angles, out=features[7:])
        if self._own:
            np.einsum("kfr,fr->kr", self._table, features, out=elements)
        else:
            np.matmul(self._table, features, out=elements)
        np.multiply(dq, dq, out=products[:3])
        np.multiply(dq[0], dq[1:], out=products[3:5])
        np.multiply(dq[1], dq[2], out=products[5])
        np.multiply(elements[39:].reshape(3, 7, -1), products, out=self._work)
        np.add.reduce(self._work, axis=1, out=self._sum)
        np.multiply(elements[:9], elements[9:18], out=self._cofactors)
        np.multiply(elements[18:27], elements[27:36], out=self._other)
        np.subtract(self._cofactors, self._other, out=self._cofactors)
        np.multiply(elements[36:39], self._cofactors[:3], out=self._other[:3])
        np.add.reduce(self._other[:3], axis=0, out=self._determinant)
        return self._sum, self._cofactors.reshape(3, 3, -1), self._determinant

    def acceleration(self, q: Array, dq: Array, torque: Array, out: Array) -> None:
        """a (3, replicas) [rad/s^2] into `out`, for q, dq and the torque that is left for motion, each (3, replicas)."""
        bias, cofactors, determinant = self.bias_and_cofactors(q, dq)
        np.subtract(torque, bias, out=bias)
        work = self._other.reshape(3, 3, -1)
        np.multiply(cofactors, bias, out=work)
        np.add.reduce(work, axis=1, out=out)
        np.divide(out, determinant, out=out)


def _tables(p: Array, a2: float, g: float, added: Array) -> Array:
    """Coefficients (60, features[, replicas]) on the features: four factors of each cofactor, D11 D12 D13, then the rows of
    c and h on the products dq1², dq2², dq3², dq1 dq2, dq1 dq3, dq2 dq3, 1."""
    one, sine, cosine = _unit(0), [_unit(k) for k in range(1, 7)], [_unit(k) for k in range(7, 13)]
    s2, s3, sS, s22, s2S, s223 = sine
    c2, c3, cS, c22, c2S, c223 = cosine
    p1, p2, p3, p4, p5, p6, p7, p8, p9, p10, p11, p12, p13, p14, p15 = p

    def row(*terms: tuple[Array | float, Array]) -> Array:
        """Σ coefficient · feature, (features[, replicas])."""
        return np.asarray(sum(np.multiply.outer(feature, coefficient) for coefficient, feature in terms))

    elements = np.array([
        row(((p1 + p5) / 2 + p7, one), (p1 / 2, c22), (p2 / 2, s22), (a2 * p3, c223 + c3), (-a2 * p4, s223 + s3),
            (p5 / 2, c2S), (-p6 / 2, s2S)),
        row((p8, cS), (p9, sS), (p10, c2), (p11, s2)),
        row((p8, cS), (p9, sS)),
        row((p12, one), (2 * a2 * p3, c3), (-2 * a2 * p4, s3)),
        row((p13, one), (a2 * p3, c3), (-a2 * p4, s3)),
        row((p13, one))])
    for element, place in zip(elements, _UPPER, strict=True):
        element[0] += added[place]
    factors = [elements[_COFACTORS[:, i, j]] for i in (0, 1) for j in (0, 1)]

    upper, fore = row((p1, s22), (-p2, c22)), row((p5, s2S), (p6, c2S))
    both, bent = row((a2 * p3, s223), (a2 * p4, c223)), row((a2 * p3, s3), (a2 * p4, c3))
    swing, lift = row((p9, cS), (-p8, sS)), row((p11, c2), (-p10, s2))
    none = np.zeros_like(swing)
    forearm = row((g * p3, cS), (-g * p4, sS))
    whole = forearm + row((g * p14, c2), (-g * p15, s2))
    bias = [none, swing + lift, swing, -(upper + 2 * both + fore), -(fore + both + bent), 2 * swing, none,
            (upper + fore) / 2 + both, none, -bent, none, none, -2 * bent, whole,
            (fore + both + bent) / 2, bent, none, none, none, none, forearm]
    return np.concatenate([*factors, elements[:3], np.array(bias)])


def _unit(index: int) -> Array:
    unit = np.zeros(_FEATURES)
    unit[index] = 1.0
    return unit
