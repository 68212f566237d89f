"""A cause that the base parameters took in, a load at the tip say, made a finding: the arm before it, and the arm with it.

The parameters fitted to the later logs hold the load. Less what the load adds to them, they are those of the bare arm, which is the
model that the reference logs gave; held-out logs say how wrong that has become, and how right the bare arm with the load is: a law
that they imitate in the fitted motion, they need not imitate in another. A longer link also has masses beyond it on a longer lever,
which the bare arm has not and the arm with it keeps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Acting, Arm
from pipelines.model.diagnosis.asked.inputs import Prepared
from pipelines.model.diagnosis.fitted.nominal import rigid_rows
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.reference.absorbed import Absorbed
from pipelines.model.diagnosis.result import Finding, ResidualRms
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.searched.beside import acted
from pipelines.model.diagnosis.worth.gains import Simulation, gain_of, no_nearer, simulation_errors, torque_gain_of, worse_log
from pipelines.model.diagnosis.worth.held_out import held_out_left
from pipelines.model.diagnosis.worth.numbers import told
from pipelines.model.diagnosis.worth.proof import proof
from pipelines.model.rigid.body import Motion

__all__ = ["Carried", "carried", "unmoved"]


@dataclass(frozen=True, eq=False)
class Carried:
    """The finding, and the model with it."""

    finding: Finding
    arm: Arm  # the bare arm with every effect, and the load around them
    bare: Arm  # without the load
    left: Array  # (rows,) [N m] of held-out rows, without the load
    doubt: str  # why it is not believed; empty where it is
    simulated: tuple[Simulation, ...]  # the bare arm, and that with the load
    shift: Array  # (rigid columns,) base parameters that hold the load

    @property
    def gained(self) -> float:
        """Share of the squared held-out torque error that it takes away, each joint by its own."""
        torque = self.finding.gain.validate_torque_rms
        return float(np.mean(1.0 - np.square(torque.after / np.maximum(torque.before, 1e-300))))


def carried(moved: Absorbed, done: Refined, whole: Arm, prepared: Prepared, standing: Sequence[Acting], blocks: int,
            draw: bool) -> Carried:
    """What the base parameters show, as a finding with its gain.

    Args:
        done: the final model of the later logs, whose base parameters hold the load.
        whole: the same as an arm, with the standing effects and all deviations.
    """
    effect, data, judge = moved.effect, done.data, prepared.judge
    load = _torque(moved, done, data)
    rigid = rigid_rows(data, done.model.columns)
    alike = np.linalg.lstsq(done.steadied(rigid * done.weights).T, done.steadied(load * done.weights), rcond=None)[0]
    shift = np.asarray(alike, dtype=np.float64)
    beta = done.model.beta.copy()
    beta[:len(shift)] -= shift
    bare = replace(done.model, beta=beta)
    before = replace(done, model=bare, left=data.y - bare.torque(data))
    rows = data if judge is None else judge
    bare_left = before.left if judge is None else judge.y - bare.torque(judge)
    left = bare_left, held_out_left(done, None, blocks) if judge is None else bare_left - _torque(moved, done, judge)
    torque = torque_gain_of(rows, *left)
    masses = np.zeros(len(whole.base)) if moved.moves is None else moved.moves
    arms = [acted(arm, standing) for arm in (bare.arm, _with_base(bare.arm, masses).extended(moved.acting))]
    simulated = simulation_errors(arms, prepared.judging or prepared.motions)
    doubt = "" if (torque.ci95[:, 1] < 0.0).any() else "what moved in the base parameters does not show on held-out torque"
    doubt = doubt or worse_log(rows, *left) or no_nearer(*simulated)
    size, joint, of_rated = _size(load, data)
    finding = Finding(effect.name, effect.joint, effect.title, told(moved.acting), moved.explained, 0.0, (), None,
                      gain_of(torque, *simulated), "base parameters", size, of_rated,
                      proof(before, done, joint + 1) if draw else None)
    by = masses.copy()
    by[list(done.model.columns.kept)] -= shift
    arm = _with_base(whole, by)
    return Carried(finding, replace(arm, effects=(*arm.effects, moved.acting)), arms[0], left[0], doubt, tuple(simulated),
                   shift)


def unmoved(one: Carried, nominal: Refined, judge: Data | None, floor: Array) -> ResidualRms:
    """[N m] What the nominal model of the later logs leaves of them less the load, as the model of the reference logs had it.

    Args:
        judge: held-out rows; None: those that were fitted.
    """
    def rms(data: Data) -> Array:
        left = nominal.left if data is nominal.data else data.y - nominal.model.torque(data)
        return data.rms(left + one.shift @ rigid_rows(data, nominal.model.columns))

    return ResidualRms(rms(nominal.data), rms(nominal.data if judge is None else judge), floor)


def _with_base(arm: Arm, by: Array) -> Arm:
    """The arm with each of its base parameters moved `by` (parameters,)."""
    return replace(arm, base=tuple(replace(p, value=p.value + float(x)) for p, x in zip(arm.base, by, strict=True)))


def _torque(moved: Absorbed, done: Refined, data: Data) -> Array:
    """(rows,) [N m] that the cause adds to the torque of the arm."""
    arm = done.model.nominal

    def torque(motion: Motion) -> Array:
        own = moved.effect.torque(motion, arm, moved.acting.values)
        return own if moved.moves is None else own + arm.body.regressor(motion.q, motion.dq, motion.ddq) @ moved.moves

    return data.lay(torque)


def _size(load: Array, data: Data) -> tuple[float, int, float]:
    """[N m] rms at the joint that feels most of it, that joint, and the share of its rated torque."""
    own = data.rms(load)
    joint = int(np.argmax(own))
    rated = data.logs[0].log.robot.joints[joint].torque
    return float(own[joint]), joint, float(own[joint] / rated) if np.isfinite(rated) and rated > 0.0 else np.nan
