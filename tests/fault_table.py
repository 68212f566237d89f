"""Every fault of a log that the doctor can meet, each made from one good log, and what must be said of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipelines.io.log import ExperimentLog
from tests.faulty import (
    clipped,
    drifting,
    dropped,
    faster,
    good_path,
    healthy_without_reference,
    repeated,
    retimed,
    runaway,
    shifted,
    spiky,
    stopped,
    turning,
    wrapped,
)
from tests.healthy import (
    changed,
    fourier,
    good_log,
    make_log,
    one_joint,
    rows,
    with_signal,
)


@dataclass(frozen=True)
class Fault:
    """One row of the table: how to make it, and the finding that must come of it."""

    row: str  # code, and what tells cases of one code apart
    make: Callable[[ExperimentLog], ExperimentLog]
    level: str
    says: str  # part of the message
    where: str = ""  # part of the place
    gate: bool | None = None
    also: tuple[str, ...] = ()  # other codes that may come along

    @property
    def code(self) -> str:
        return f"RRID-{self.row[:3]}"


FAULTS = (
    Fault("S05", lambda g: with_signal(g, tau=1000.0 * g.tau), "reject", "looks like N mm (1000 times too large)", "signal tau"),
    Fault("S05 measured", lambda g: replace(with_signal(g, tau=1000.0 * g.tau), torque="measured"),
          "warn", "looks like N mm", "signal tau", True, also=("RRID-S15",)),
    Fault("S07", lambda g: with_signal(g, q=np.rad2deg(g.q)), "reject", "looks like degrees or the motor", "signal q, joint 1"),
    Fault("S08 ms", lambda g: retimed(g, lambda t: t * 1000.0), "repair", "is in ms", "signal t"),
    Fault("S08 index", lambda g: replace(retimed(g, lambda t: np.arange(t.size) * 1.0), sample_time=0.0008),
          "repair", "sample numbers", "signal t", also=("RRID-D12",)),
    Fault("S08 neither", lambda g: retimed(g, lambda t: t * 2.5), "reject", "no unit of time", "signal t"),
    Fault("S09", lambda g: replace(g, sample_time=1000.0), "reject", "holds the rate", "signal t"),
    Fault("S13 tau", lambda g: with_signal(g, tau=g.tau[:, [0, 2, 1]]),
          "warn", "tau: columns 2,3 fit swapped", "signal tau", True, also=("RRID-D05",)),
    Fault("S13 q", lambda g: with_signal(healthy_without_reference(g), q=g.q[:, [0, 2, 1]]),
          "warn", "q: columns 2,3 fit swapped", "signal q", True),
    Fault("S14", lambda g: with_signal(g, tau=g.tau * [1, -1, 1]),
          "warn", "joint 2 looks flipped", "signal tau, joint 2", True),
    Fault("S14 all", lambda g: with_signal(g, tau=-g.tau), "warn", "all joints looks flipped", "signal tau, joint 1", True),
    Fault("S15 torque", lambda g: with_signal(g, tau=g.tau * [0.02, 1, 1]),
          "warn", "tau of joint 1 is 0.02 times", "joint 1", True),
    Fault("S15 encoder", lambda g: with_signal(healthy_without_reference(g), q=g.q * [1, 2, 1]),
          "warn", "q of joint 2 fits if multiplied by 0.5", "joint 2", True, also=("RRID-D12", "RRID-D08")),
    Fault("S16", lambda g: with_signal(g, q_ref=good_log(9)["q_ref"]), "reject", "not of the same run", "signal q_ref", True),
    Fault("T01", lambda g: retimed(g, lambda t: np.where(np.arange(t.size) < 3000, t, t - 1.5)),
          "repair", "first by 1.499 s", "sample 3000"),
    Fault("T01 often", lambda g: retimed(g, lambda t: t - 0.05 * (np.arange(t.size) // 300)),
          "reject", "19 times", "sample 300"),
    Fault("T02 still", lambda g: retimed(g, np.zeros_like), "reject", "stands still at 0", "sample 1"),
    Fault("T02", repeated, "repair", "1 sample twice", "sample 3001"),
    Fault("T02 conflict", lambda g: changed(repeated(g), "q", (3001, 1), 0.3), "reject", "different values", "sample 3001"),
    Fault("T03", lambda g: dropped(g, lambda k: k[~np.isin(k % 600, (500, 501))]),
          "warn", "20 samples (0.33 %) dropped at 10 places", "sample 499"),
    Fault("T04", lambda g: dropped(g, lambda k: (k < 2000) | (k > 2500)),
          "repair", "the longest of 2 usable parts has 3499", "sample 1999"),
    Fault("T04 shreds", lambda g: dropped(g, lambda k: k % 200 < 60),
          "reject", "no stretch between them has 100 samples", "sample 59"),
    Fault("T05", lambda g: retimed(g, lambda t: t + np.random.default_rng(1).uniform(-0.0002, 0.0002, t.size)),
          "warn", "varies: rms 16", "signal t"),
    Fault("T06", lambda g: with_signal(g, tau=np.roll(g.tau, 3, axis=0)), "warn", "3.00 ±", "signal tau", False),
    Fault("T06 drift", lambda g: drifting(g, 5.0), "warn", "clocks of q and tau drift by", "signal tau", True),
    Fault("T07", lambda g: replace(g, period=10.0), "reject", "6 s < 10 s period", "signal t"),
    Fault("T08", lambda g: rows(g, slice(0, 1)), "reject", "1 sample", "signal t"),
    Fault("T08 none", lambda g: rows(g, slice(0, 0)), "reject", "0 samples", "signal t"),
    Fault("T09", lambda g: make_log(fourier(np.random.default_rng(1), base_hz=0.4), sample_time=0.1, duration=60),
          "reject", "too low for this motion", "signal q"),
    Fault("D01", lambda g: changed(g, "q", ([100, 900, 901], 1), np.nan),
          "repair", "3 samples of q missing", "signal q, joint 2, sample 100"),
    Fault("D02 block", lambda g: changed(g, "tau", (slice(2000, 2400), 0), np.nan),
          "repair", "400 samples of tau", "signal tau, joint 1, sample 2000"),
    Fault("D02 channel", lambda g: changed(g, "q", (slice(None), 1), np.nan),
          "reject", "no measurement at all", "signal q, joint 2"),
    Fault("D02 reference", lambda g: changed(g, "dq_ref", (slice(None), 1), np.nan),
          "warn", "no measurement at all", "signal dq_ref, joint 2", True),
    Fault("D03 inf", lambda g: changed(g, "tau", ([400, 401], 1), np.inf),
          "repair", "samples 400, 401", "signal tau, joint 2, sample 400"),
    Fault("D03 filler", lambda g: changed(g, "q", ([10, 20, 30], 0), -999.0), "repair", "-999", "signal q, joint 1, sample 10"),
    Fault("D03 mostly", lambda g: changed(g, "q", (slice(0, 1000), 0), -999.0), "reject", "1000 samples", "signal q, joint 1"),
    Fault("D04 tau", lambda g: changed(g, "tau", (slice(None), 1), 0.3),
          "reject", "tau of joint 2 is constant", "signal tau, joint 2"),
    Fault("D05 limit", lambda g: make_log(good_path(), torque=clipped),
          "warn", "described limit of 30", "signal tau, joint 2", True),
    Fault("D05 flat top", lambda g: with_signal(g, tau=np.clip(g.tau, -8, 8)),
          "warn", "flat top at 8 N m", "signal tau, joint 1", True),
    Fault("D06 q", lambda g: spiky(g, "q", 1, 0.05), "repair", "12 samples of q", "signal q, joint 2"),
    Fault("D07 turn", wrapped, "warn", "by 6.28319 rad; unwrapped", "signal q, joint 1", False),
    Fault("D07 counter", lambda g: shifted(healthy_without_reference(g), 0.65536),
          "warn", "1 time by 0.65536", "joint 2, sample 2501", False),
    Fault("D07 lost", lambda g: shifted(healthy_without_reference(g), 0.3),
          "warn", "loses counts|no turn", "joint 2, sample 2501", True),
    Fault("D08", lambda g: with_signal(g, q=0.001 * np.rint(g.q / 0.001)), "warn", "R = δ²/12 = 8.33e-08", "signal q, joint 1"),
    Fault("D09", lambda g: make_log(one_joint(good_path(), 2)), "warn", "no sample shows p1, p2, p5, p6, p7", gate=True, also=("RRID-D04",)),
    Fault("D10", lambda g: make_log(turning(6.0, 1)),
          "warn", "joint 2 never changes sign", "joint 2", True, also=("RRID-D05", "RRID-D09")),
    Fault("D11 power", stopped, "warn", "torques drop to zero", "sample 4000"),
    Fault("D11 tracking", runaway, "warn", "joint 3 leaves its reference", "sample 4", also=("RRID-D12",)),
    Fault("D12", lambda g: make_log(faster(3.0)), "warn", "times its limit", "signal q", True, also=("RRID-D05",)),
    Fault("D16 friction", lambda g: make_log(good_path(), "friction", joint=1),
          "warn", "joint 2 moves by", "signal q, joint 2", True),
    Fault("D16 hold", lambda g: replace(g, experiment="hold"), "warn", "joint 1 moves by", "signal q, joint 1", True),
)
