"""A report such as `inspect` writes, of a made-up log with a gap, a saturation and a lost encoder."""

from __future__ import annotations

import numpy as np

from pipelines.errors import Check
from pipelines.report.figures import joint_signal_figure
from pipelines.report.report import Report, Section, Table
from pipelines.report.sections import checks_table
from pipelines.report.style import with_std

FOOTER = {"made by": "rrrid inspect sample_logs/tx40_excitation.h5 --out runs", "version": "0.1.0",
          "input": "tx40_excitation.h5, SHA-256 9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08",
          "settings": "defaults", "seed": "0"}


def demo_report(samples: int = 60_000, joints: int = 6) -> Report:
    rng = np.random.default_rng(7)
    t = np.arange(samples) / 5000.0 + rng.normal(0.0, 2e-6, samples)
    t[samples // 2:] += 0.4
    rate = np.linspace(0.7, 1.9, joints)
    q = np.sin(2.0 * np.pi * rate * t[:, None]) * np.linspace(1.5, 0.4, joints)
    tau = 20.0 * np.cos(2.0 * np.pi * rate * t[:, None]) + rng.normal(0.0, 0.6, (samples, joints))
    tau = np.clip(tau, -19.5, 19.5)
    full = np.abs(tau) >= 19.5
    full[:, 2:] = False
    q[samples // 5: samples // 4, 1] = np.nan
    names = [f"joint {number}" for number in range(1, joints + 1)]
    checks = [Check.of("T05", "repair", "400 ms without a sample; the log was split there", where="t[30000]",
                       remedy="record again if one uninterrupted experiment is needed"),
              Check.of("S11", "warn", "torque of joints 1 and 2 rests at its limit for 3.1 % of the time",
                       where="tau, joints 1-2", remedy="lower the amplitude; no fit uses these samples"),
              Check.of("S02", "reject", "position of joint 2 is missing for 0.6 s",
                       where="q[:, 1], samples 12000-15000", remedy="check the encoder cable"),
              Check.of("F01", "ok", "HDF5 container, digest agrees"), Check.of("S05", "ok", "all units are SI"),
              Check.of("T01", "ok", "time rises strictly")]
    ranges = Table(("joint", "range used [rad]", "of its limits [%]", "peak torque [N m]", "torque noise [N m]"),
                   tuple((name, 2.0 * (1.5 - 0.2 * i), 97.0 - 13.7 * i, 19.5, with_std(0.6 / (i + 1), 0.012))
                         for i, name in enumerate(names)), caption="What the experiment used of the robot's range.")
    key = Table(("", "value", "meaning"), (
        ("duration", "12.4 s", "60 000 samples of 6 joints at 5 kHz"),
        ("usable for identification", "91.2 %", "the rest is missing or at a torque limit"),
        ("sampling jitter", with_std(2.83, 0.02) + " µs", "1.4 % of the sample time: harmless"),
        ("longest gap", "0.40 s", "the log was split here")))
    return Report(
        "Inspection of tx40_excitation.h5", "One joint lost its encoder for 0.6 s; the rest of the log can be used.",
        "attention", key, (
            Section("What was checked", ("Six checks, three found something. Nothing in the file was changed.",),
                    (checks_table(checks),)),
            Section("Sampling", ("The log has one gap. Between the samples the clock is steady.",)),
            Section("Signals", ("Each row is one joint.",), (ranges,), (
                joint_signal_figure("position", "Position over time. The shaded stretch of joint 2 holds no samples.",
                                    t, q, "position [rad]", names=names, flagged=np.isnan(q),
                                    flag_name="missing"),
                joint_signal_figure("torque", "Torque over time. Marked samples rest at the limit of ±19.5 N m and say "
                                    "nothing about the arm.", t, tau, "torque [N m]", names=names,
                                    flagged=full, flag_name="at the limit"))),
            Section("What comes next", ("The marked samples are left out of every later fit.",))))
