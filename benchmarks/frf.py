"""Frequency responses against their bars, on the virtual test bench.

    nice python -m benchmarks.frf [accuracy grouping disturbance controller] [--logs FOLDER] [--cases 0 1 2 …]

accuracy      12 machines × 2 postures, base at 24-32 Hz and a joint with its resonance at 40-120 Hz, 60 s each: every mode
              beside the plant linearised at the speed of the turn; share inside the 95 % bands
grouping      24 cases of base, joint, delay or nothing, two postures each: what is said, and what is said wrongly
disturbance   a strong torque disturbance in the loop: direct and default method beside the truth
controller    eq. (29) with the continuous instead of the sampled controller, at 28 and 80 Hz

Logs are kept in FOLDER: recording takes most of the time.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipelines.fit.rational import Mode
from pipelines.io.experiment import Array, Controller, ExperimentLog
from pipelines.io.files import open_log, write_log
from pipelines.model.frf.controller import continuous_controller, sampled_controller
from pipelines.model.frf.findings import frf_findings
from pipelines.model.frf.modes import fitted_modes
from pipelines.model.frf.responses import double_integrator, measured_responses
from pipelines.signal.frequency_response import FrequencyResponse, indirect
from tests.frf.cases import Case, accuracy_case, recorded, sealed_case, truth_of

_CACHE = Path(tempfile.gettempdir()) / "rrrid-frf"
_SEEN = (8.0, 200.0)  # [Hz] of the modes that count


def logs_of(case: Case, folder: Path) -> list[ExperimentLog]:
    """The case's logs, recorded where they are not there yet."""
    folder.mkdir(parents=True, exist_ok=True)
    logs = []
    for k in range(len(case.excited)):
        path = folder / f"{case.name}-{k + 1}.h5"
        if not path.exists():
            (log,) = recorded(case, [k])
            write_log(path, log)
        logs.append(open_log(path).log)
    return logs


def true_modes(case: Case, log: ExperimentLog) -> list[tuple[str, float, float]]:
    """Kind, frequency [Hz] and damping of every mode that the plant has at all angles of the turn, mean over them."""
    several = [truth.modes(_SEEN) for truth in truth_of(case, log)]
    found = []
    for kind, place in (("resonance", 0), ("antiresonance", 1)):
        for frequency, damping in several[0][place]:
            near = [modes[place][np.argmin(np.abs(modes[place][:, 0] - frequency))] for modes in several if len(modes[place])]
            if len(near) == len(several) and all(abs(one[0] - frequency) < 0.05 * frequency
                                                 and abs(one[1] - damping) < 0.4 * damping for one in near):
                found.append((kind, float(np.mean([one[0] for one in near])), float(np.mean([one[1] for one in near]))))
    return found


def accuracy(numbers: Iterable[int], folder: Path) -> None:
    """Every true mode beside the one that was found nearest to it."""
    rows: list[tuple[float, float, bool, bool]] = []
    missed = 0
    for number in numbers:
        case = accuracy_case(number)
        for log in logs_of(case, folder):
            (measured,) = measured_responses([log])
            modes = fitted_modes(measured)
            for kind, frequency, damping in true_modes(case, log):
                near = [m for m in (*modes.modes, *modes.traces)
                        if m.kind == kind and abs(m.frequency.value - frequency) < 0.1 * frequency]
                if not near:
                    missed += 1
                    print(f"{log.name}  joint {log.joint}  {kind:14s} {frequency:8.3f} Hz  missed")
                    continue
                rows.append(_row(log, min(near, key=lambda m: abs(m.frequency.value - frequency)), frequency, damping))
    off, damped, inside, damping_inside = (np.array(column) for column in zip(*rows, strict=True))
    print(f"{len(rows)} modes, {missed} missed. Inside 95 % bands: frequency {inside.mean():.2f}, "
          f"damping {damping_inside.mean():.2f}")
    for name, values, bar in (("frequency", off, 0.01), ("damping", damped, 0.15)):
        print(f"{name}: worst {100.0 * values.max():.2f} %, median {100.0 * np.median(values):.3f} %, within {100.0 * bar:g} %: "
              f"{(values < bar).sum()}")


def _row(log: ExperimentLog, mode: Mode, frequency: float, damping: float) -> tuple[float, float, bool, bool]:
    f, d = mode.frequency, mode.damping
    off, damped = abs(f.value / frequency - 1.0), abs(d.value / damping - 1.0)
    print(f"{log.name}  joint {log.joint}  {mode.kind:14s} {frequency:8.3f} Hz  found {f.value:8.3f} ± {f.std:.3f} "
          f"({100.0 * off:5.2f} %)   damping {damping:.4f}  found {d.value:.4f} ± {d.std:.4f} ({100.0 * damped:5.1f} %)"
          f"{'' if mode.distinct else '  trace'}",
          flush=True)
    return off, damped, abs(f.value - frequency) < 1.96 * f.std, abs(d.value - damping) < 1.96 * d.std


def grouping(numbers: Iterable[int], folder: Path) -> None:
    """What each case is said to be."""
    right = wrong = undecided = total = 0
    for number in numbers:
        case = sealed_case(number)
        found = frf_findings(logs_of(case, folder))
        said = sorted({(one.kind, one.joint) for one in found.classification}, key=str)
        wanted = (case.kind, None if case.kind == "base" else case.joint)
        verdict = "right" if said == [wanted] and not found.undecided else "undecided" if found.undecided else "WRONG"
        total += 1
        right, wrong, undecided = right + (verdict == "right"), wrong + (verdict == "WRONG"), undecided + (verdict == "undecided")
        print(f"{case.name}: {wanted} said {said}, {len(found.undecided)} open: {verdict}", flush=True)
        for one in found.undecided:
            print("      ", one.evidence)
    print(f"{right} of {total} right, {undecided} undecided, {wrong} wrong")


def disturbance(folder: Path, torque: float = 6.0, duration: float = 60.0) -> None:
    """White torque noise of `torque` [N m] rms at joint 1, as strong as the excitation."""
    case = accuracy_case(0, duration)
    noisy = replace(case.machine, amplifier_noise=(torque, *case.machine.amplifier_noise[1:]))
    case = replace(case, name=f"disturbed-{torque:g}-{duration:g}", machine=noisy, faults=(), strength=1.0,
                   excited=case.excited[:1])
    (log,) = logs_of(case, folder)
    (measured,) = measured_responses([log])
    truth, fit = truth_of(case, log)[0], fitted_modes(measured).fit
    for low, high in ((1.0, 3.0), (4.0, 10.0), (10.0, 100.0)):
        for name, response in (("default", measured.plant), ("direct", measured.direct)):
            part = response.within(low, high)
            off = np.abs(part.response / truth.response(part.frequency) - 1.0)
            print(f"{low:4g}-{high:4g} Hz  {name:8s} median error of a line {100.0 * np.median(off):6.2f} %, "
                  f"coherence {np.median(part.coherence):.2f}")
        if low >= 4.0:
            frequency = np.linspace(low, high, 60)
            off = np.abs(fit.response(frequency) * double_integrator(frequency, 1e-3) / truth.response(frequency) - 1.0)
            print(f"{low:4g}-{high:4g} Hz  default, its rational function: worst {100.0 * off.max():.2f} %")


def controller() -> None:
    """Error of (29) with C(jω), for kp = 400, kd = 28, 1 ms."""
    frequency: Array = np.array([5.0, 28.0, 80.0, 200.0])
    own = Controller("computed-torque", kp=np.array([400.0]), kd=np.array([28.0]), velocity="backward-difference")
    plant = double_integrator(frequency, 1e-3)
    sampled, smooth = sampled_controller(own, 1, frequency, 1e-3), continuous_controller(own, 1, frequency)
    assert sampled is not None
    assert smooth is not None
    zero, one = np.zeros(4), np.ones(4)
    sensitivity = FrequencyResponse(frequency, 1.0 / (1.0 + plant * sampled), zero, one, "exact", 1.0, np.inf, 1.0)
    for name, c in (("sampled", sampled), ("continuous", smooth)):
        error = np.abs(indirect(sensitivity, c).response / plant - 1.0)
        print(f"{name:10s} " + "  ".join(f"{f:g} Hz: {100.0 * e:.2g} %" for f, e in zip(frequency, error, strict=True)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="*", default=["accuracy", "grouping", "disturbance", "controller"])
    parser.add_argument("--logs", type=Path, default=_CACHE)
    parser.add_argument("--cases", type=int, nargs="*")
    given = parser.parse_args()
    for what in given.what:
        print(f"== {what}")
        if what == "accuracy":
            accuracy(given.cases or range(12), given.logs)
        elif what == "grouping":
            grouping(given.cases or range(24), given.logs)
        elif what == "disturbance":
            disturbance(given.logs)
        else:
            controller()


if __name__ == "__main__":
    main()
