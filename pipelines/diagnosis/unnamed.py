"""Shapes without a name, of every joint: where one predicts better than every cause, none is known.

    Unnamed.of(dataset, config).every         columns of the motion by key
    in_words(key)                             what such a shape, or a cause, is called

They are splines of the position, speed and torque of a joint, ripple of its drive, of any order,
the form of its friction law, and dry and viscous friction that drift.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import legvander

from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.dataset import Dataset
from pipelines.dynamics.body import Motion
from pipelines.estimation.candidate_columns import place_of
from pipelines.estimation.joint_table import Array

__all__ = ["FORM", "Key", "Make", "Unnamed", "in_words"]

FORM = "friction form"
_WORDS = {
    "spline of q": "a curve over the position of joint {}",
    "spline of dq": "a curve over the speed of joint {}",
    "spline of tau": "a curve over the torque of joint {}",
    "drift of friction": "friction of joint {} that drifts",
    FORM: "another law of friction at joint {}",
}

Key = tuple[str, int | None]  # a cause, or a shape without a name, and its joint
Make = Callable[[Motion], Array]  # (samples, k) on one joint


def in_words(key: Key) -> str:
    """Return "cogging:2" of a cause, and what it is of a shape without a name."""
    cause, joint = key
    if cause.startswith("ripple "):
        return f"a torque ripple of joint {joint} ({cause.removeprefix('ripple ')} a turn)"
    return _WORDS[cause].format(joint) if cause in _WORDS else place_of(cause, joint)


@dataclass(frozen=True, eq=False)
class Unnamed:
    """Shapes without a name, over the range that the logs cover."""

    dataset: Dataset
    config: DiagnosisConfig
    motions: tuple[Motion, ...]  # of the reference and the later logs

    @classmethod
    def of(cls, dataset: Dataset, config: DiagnosisConfig) -> Unnamed:
        """Return the shapes over the motion of all logs."""
        rows = [rows for rows in (dataset.reference, dataset.later) if rows]
        return cls(dataset, config, tuple(one.motion for some in rows for one in some.data.logs))

    @property
    def every(self) -> dict[Key, Make]:
        """The columns of each shape, a function of the motion."""
        found = dict[Key, Make]()
        for j in range(self.dataset.later.n_joints):
            found[FORM, j + 1] = self._form(j)
            found["drift of friction", j + 1] = self._drift(j)
            for kind in ("q", "dq", "tau"):
                found[f"spline of {kind}", j + 1] = self._spline(kind, j)
            for order in range(1, self.config.ripple_orders + 1):
                found[f"ripple {order}", j + 1] = self._ripple(order, j)
        return found

    def _signal(self, kind: str, motion: Motion, j: int) -> Array:
        nominal = self.dataset.model.nominal
        values = nominal.torque(motion) if kind == "tau" else getattr(motion, kind)
        return np.asarray(values[:, j])

    def _spline(self, kind: str, j: int) -> Make:
        """Return cubic B-splines of a signal."""
        from scipy.interpolate import BSpline

        every = np.concatenate([self._signal(kind, motion, j) for motion in self.motions])
        low, high = float(every.min()), float(every.max())
        knots = np.r_[[low] * 3, np.linspace(low, high, self.config.knots - 2), [high] * 3]
        inside = high - 1e-9 * (high - low)

        def make(motion: Motion) -> Array:
            x = np.clip(self._signal(kind, motion, j), low, inside)
            return np.asarray(BSpline.design_matrix(x, knots, 3).toarray())

        return make

    def _ripple(self, order: int, j: int) -> Make:
        """Return the waves of an order, times the torque."""

        def make(motion: Motion) -> Array:
            angle = order * motion.q[:, j]
            waves = np.stack([np.sin(angle), np.cos(angle)], 1)
            return np.asarray(self._signal("tau", motion, j)[:, None] * waves)

        return make

    def _widths(self, j: int) -> Array:
        """Return speeds over which friction changes its sign, from the nominal law's to the top."""
        top = max(float(np.abs(motion.dq[:, j]).max()) for motion in self.motions)
        own = [law for law in self.dataset.model.columns.laws if law.joint == j + 1]
        sharp = next((law.sharpness for law in own if hasattr(law, "sharpness")), 1.0 / top)
        return np.asarray(np.geomspace(0.5 / sharp, top, self.config.form_widths))

    def _form(self, j: int) -> Make:
        """Return sigmoids tanh(dq / w) of any widths w (Kostić et al. 2004, eq. 7).

        No law has the form of a machine's friction at every speed.
        """
        widths = self._widths(j)
        return lambda motion: np.asarray(np.tanh(motion.dq[:, j, None] / widths))

    def _drift(self, j: int) -> Make:
        """Return dry and viscous friction times polynomials of the session's time, or each log's.

        Two days, reference and later logs, have no time in common.
        """
        clocks = [one.motion.t for one in self.dataset.later.data.logs]
        start = self.dataset.session_start if self.dataset.reference is None else None
        session = [np.concatenate(clocks)] if start is not None else clocks
        span = max(1e-9, *(float(np.ptp(t)) for t in session))
        width = self._widths(j)[0]

        def make(motion: Motion) -> Array:
            since = (motion.t - (motion.t[0] if start is None else start)) / span
            course = legvander(np.clip(2.0 * since - 1.0, -1.0, 1.0), self.config.drift_order)
            dq = motion.dq[:, j, None]
            return np.concatenate([course[:, 1:] * np.tanh(dq / width), course[:, 1:] * dq], 1)

        return make
