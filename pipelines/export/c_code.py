"""Write a C99 function: the torque that a log of a motion should show, with all that has a formula.

The equations are not written twice: those of the arm run once on symbols, and every operation of
theirs becomes one line of C, equal ones only once. Loads of a joint come from `Effect.speed_curve`,
`own_load` and `own_memory`, the rigid body from the recursive Newton-Euler algorithm (Luh, Walker &
Paul 1980). What an encoder misreads is corrected first, what a drive changes comes last, in the
order of `Arm.torque`.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pipelines.dynamics.arm import Acting
from pipelines.dynamics.body import Motion
from pipelines.dynamics.chain import spatial_inertia
from pipelines.dynamics.functions import Functions
from pipelines.effects.base import Effect
from pipelines.export.config import EXPORT
from pipelines.export.target import Held, Loaded, Target

__all__ = ["C"]

_APPROXIMATED = {
    "presliding": "its state moves by one midpoint step a call",
    "time_delay": "a Taylor series to the acceleration",
}
_ROUNDS = 6  # numerics: of the fixed point of an eccentric encoder, as in the effect itself
_Vector = Any  # array of objects: symbols and numbers


@dataclass
class _Lines:
    """Statements, each with a name for its value; equal expressions have one."""

    known: dict[str, str] = field(default_factory=dict)

    def value(self, text: str) -> _Value:
        """Return the value of an expression."""
        return _Value(self, self.known.setdefault(text, f"x{len(self.known)}"))

    def needed(self, ends: str) -> list[str]:
        """Return the statements that the last ones need."""
        used, found = set(re.findall(r"\bx\d+\b", ends)), []
        for expression, name in reversed(self.known.items()):
            if name in used:
                used |= set(re.findall(r"\bx\d+\b", expression))
                found.append(f"    const double {name} = {expression};")
        return found[::-1]


def _operator(sign: str, swapped: bool = False) -> Callable[[_Value, Any], Any]:
    """Return an operator that writes a line, but where nothing is added or multiplied by 0 or 1."""

    def method(self: _Value, other: Any) -> Any:
        if isinstance(other, np.ndarray):
            return NotImplemented
        number = None if isinstance(other, _Value) else float(other)
        if sign == "*" and number in (0.0, 1.0, -1.0):
            return 0.0 if number == 0.0 else self if number == 1.0 else -self
        if sign in "+-" and number == 0.0:
            return -self if sign == "-" and swapped else self
        one, two = (other, self) if swapped else (self, other)
        return self.lines.value(f"{_text(one)} {sign} {_text(two)}")

    return method


@dataclass(frozen=True, eq=False)
class _Value:
    """A number of the C function; operators write a line."""

    lines: _Lines
    name: str
    __add__, __radd__ = _operator("+"), _operator("+", True)
    __sub__, __rsub__ = _operator("-"), _operator("-", True)
    __mul__, __rmul__ = _operator("*"), _operator("*", True)
    __truediv__, __rtruediv__ = _operator("/"), _operator("/", True)

    def __neg__(self) -> _Value:
        return self.lines.value(f"-{self.name}")

    def __abs__(self) -> _Value:
        return self.lines.value(f"fabs({self.name})")

    def __pow__(self, power: float) -> _Value:
        return self.lines.value(f"pow({self.name}, {_text(power)})")

    def __lt__(self, other: Any) -> str:
        return f"{self.name} < {_text(other)}"

    def __gt__(self, other: Any) -> str:
        return f"{self.name} > {_text(other)}"


def _text(value: Any) -> str:
    """Return a value as C: a name, or a number with all its digits."""
    text = value.name if isinstance(value, _Value) else repr(float(value))
    return f"({text})" if text.startswith("-") else text


def _functions(lines: _Lines) -> Functions:
    def called(name: str) -> Callable[..., Any]:
        return lambda *given: lines.value(f"{name}({', '.join(map(_text, given))})")

    def sign(x: Any) -> Any:
        return lines.value(f"(double)({_text(x)} > 0.0) - (double)({_text(x)} < 0.0)")

    def where(condition: str, one: Any, other: Any) -> Any:
        return lines.value(f"{condition} ? {_text(one)} : {_text(other)}")

    sine, cosine, tanh, exp = map(called, ("sin", "cos", "tanh", "exp"))
    nearest, smaller, larger = map(called, ("rint", "fmin", "fmax"))
    return Functions(sine, cosine, tanh, exp, sign, nearest, smaller, larger, where)


class _Program:
    """The torque of an arm, statement by statement."""

    def __init__(self, held: Held) -> None:
        self.held, self.lines = held, _Lines()
        self.m, self.t = _functions(self.lines), self.lines.value("t")
        every = range(len(held.joints))
        self.q, self.v, self.a = (
            np.array([self.lines.value(f"{name}[{i}]") for i in every], dtype=object)
            for name in ("q", "dq", "ddq")
        )
        self.memory: list[Any] = []  # next value of each
        arm = held.arm
        loads = []  # each with the motion that it sees, from the outermost
        for acting in reversed(arm.effects):
            if acting.effect.name in _ENCODERS:
                self._read(acting)
            else:
                loads.append((acting, self.q.copy(), self.v.copy(), self.a.copy()))
        self.rigid = self._rigid()
        self.tau = np.array([0.0] * len(self.q), dtype=object)
        self.friction: _Vector = None  # of all laws, known when effects come
        for law in arm.friction:  # they see the rigid body, not each other
            self._load(law)
        self.friction, self.tau = self.tau.copy(), self.rigid + self.tau
        for acting, self.q, self.v, self.a in reversed(loads):
            self._load(acting)

    def _read(self, acting: Acting) -> None:
        """Correct position, speed and acceleration by what an encoder misreads."""
        j, x, m = (acting.effect.joint or 1) - 1, acting.values, self.m
        q, v, a = self.q, self.v, self.a
        match acting.effect.name:
            case "encoder_eccentricity":  # q_measured = q + A sin(q + φ), solved for q
                size, phase, measured = x["amplitude"], x["phase"], q[j]
                for _ in range(_ROUNDS):
                    q[j] = measured - size * m.sin(q[j] + phase)
                slope = 1.0 + size * m.cos(q[j] + phase)
                v[j] = v[j] / slope
                a[j] = (a[j] + size * m.sin(q[j] + phase) * v[j] * v[j]) / slope
            case "encoder_crosstalk":  # q_j = q_measured,j - c q_i
                for state in (q, v, a):
                    state[j] -= x["coefficient"] * state[int(x["from_joint"]) - 1]
            case _:  # a delay, q(t) = q_measured(t + Δ), to second order: the jerk is not known
                q[j] += x["delay"] * (v[j] + 0.5 * x["delay"] * a[j])
                v[j] += x["delay"] * a[j]

    def _load(self, acting: Acting) -> None:
        """Add what a cause makes of the torque so far."""
        effect, x, j = acting.effect, acting.values, (acting.effect.joint or 1) - 1
        tau, v, m = self.tau, self.v, self.m
        match effect.name:
            case "load_friction":  # µ |τ_l| tanh(w v) / (1 - i µ c)
                side, into = m.tanh(x["sharpness"] * v[j]), x["input_side"] * x["mu"]
                load = self.rigid[j]
                if self.friction is not None:  # as a law of friction it knows neither s nor i
                    load = tau[j] - (1.0 - x["behind"]) * self.friction[j]
                    side = side / (1.0 - into * (m.sign(load) * side)) if into else side
                tau[j] += x["mu"] * abs(load) * side
            case "rotor_inertia":
                tau[j] += x["inertia"] * self.a[j]
            case "viscous_drift":  # r Fv (1 - e^(-t/T)) v
                change = effect.curve(np.array([1.0]), self.held.arm.nominal, x).item()
                left = m.exp(m.larger(self.t, 0.0) * (-1.0 / x["time_constant"]))
                tau[j] += change * (1.0 - left) * v[j]
            case "transmission_coupling":  # J ds/dt + B s + C tanh(w s), s = v_j + ρ v_i
                unit = effect.simulate(self.held.arm, {**x, "inertia": 1.0}).inertia
                i = int(x["with_joint"]) - 1
                ratio = 1.0 if unit is None else float(unit[j, i])
                s = v[j] + ratio * v[i]
                shared = x["inertia"] * (self.a[j] + ratio * self.a[i]) + x["viscous"] * s
                shared += x["coulomb"] * m.tanh(x["sharpness"] * s)
                tau[j] += shared
                tau[i] += ratio * shared
            case "torque_gain":
                tau[j] = tau[j] / (1.0 + x["gain_error"])
            case "torque_crosstalk":
                tau[j] += x["coefficient"] * tau[int(x["from_joint"]) - 1]
            case "torque_saturation":
                inside = m.smaller(m.larger(tau[j], -x["limit"]), x["limit"])
                tau[j] += x["coefficient"] * (tau[j] - inside)
            case _:
                tau[j] += self._own(effect, x, j)

    def _own(self, effect: Effect, x: Mapping[str, float], j: int) -> Any:
        """Return a load that follows from the joint's own motion."""
        if (curve := effect.speed_curve(x)) is not None:
            return curve.of(self.v[j], self.m)
        if (load := effect.own_load(x)) is not None:
            return load(self.q[j], self.v[j], self.m)
        own, step = effect.own_memory(x), self.lines.value("dt")
        assert own is not None  # by `_carry`
        now = self.lines.value(f"state->memory[{len(self.memory)}]")
        half = now + 0.5 * step * own.rate(now, self.v[j], self.m)
        bound = 1.0 + x.get("breakaway", 0.0)  # as far as it can bend
        then = self.m.smaller(now + step * own.rate(half, self.v[j], self.m), bound)
        then = self.m.larger(then, -bound)
        self.memory.append(then)
        return own.load(then, own.rate(then, self.v[j], self.m))

    def _rigid(self) -> _Vector:
        """Return the torque of the rigid body (joints,), by recursion outwards and back.

        n = I α + ω × I ω + h × a,      f = m a + α × h + ω × (ω × h)
        """
        held, cross = self.held, np.cross
        phi = np.linalg.pinv(held.links.base) @ held.arm.p  # any links with these base parameters
        phi[np.abs(phi) < 1e-14 * np.abs(phi).max()] = 0.0
        w, dw, a = np.zeros((3, 3)).astype(object)
        a = a - held.gravity
        passed, tau = [], np.array([0.0] * len(self.q), dtype=object)
        for i, joint in enumerate(held.joints):
            turn, p, axis = joint.origin.rotation.astype(object), joint.origin.position, joint.axis
            if joint.revolute:
                c, s = self.m.cos(self.q[i]), self.m.sin(self.q[i])
                along, across = np.outer(axis, axis), cross(axis, np.eye(3)).T
                turn = turn @ (along + c * (np.eye(3) - along) + s * across)  # Rodrigues
            else:
                p = p + joint.origin.rotation @ axis * self.q[i]
            a = turn.T @ (a + cross(dw, p) + cross(w, cross(w, p)))
            w, dw, own = turn.T @ w, turn.T @ dw, axis * self.v[i]
            if joint.revolute:
                w, dw = w + own, dw + cross(w, own) + axis * self.a[i]
            else:
                a = a + 2.0 * cross(w, own) + axis * self.a[i]
            inertia, h = spatial_inertia(phi[10 * i :][:10])[:3, :3], phi[10 * i + 1 :][:3]
            n = inertia @ dw + cross(w, inertia @ w) + cross(h, a)
            f = phi[10 * i] * a + cross(dw, h) + cross(w, cross(w, h))
            passed.append((turn, p, n, f))
        n, f = np.zeros((2, 3)).astype(object)
        for i, (turn, p, own_n, own_f) in reversed(list(enumerate(passed))):
            n, f = n + own_n, f + own_f
            tau[i] = held.joints[i].axis @ (n if held.joints[i].revolute else f)
            f = turn @ f
            n = turn @ n + cross(p, f)
        return tau


_LOADS = {"load_friction", "rotor_inertia", "viscous_drift", "transmission_coupling"}
_LOADS |= {"torque_gain", "torque_crosstalk", "torque_saturation"}
_ENCODERS = {"encoder_eccentricity", "encoder_crosstalk", "time_delay"}


def _carry(acting: Acting) -> Acting | None:
    """Return a cause that the C function has."""
    effect, values = acting.effect, acting.values
    if effect.name in _LOADS | _ENCODERS:
        return acting
    own = (effect.speed_curve, effect.own_load, effect.own_memory)
    return acting if effect.joint and any(f(values) is not None for f in own) else None


def _write(held: Held) -> tuple[dict[str, str], tuple[str, ...]]:
    """Return the texts of a header and a source."""
    o = _Program(held)
    name, n, states = _name(held), len(held.joints), len(o.memory)
    vectors = ", ".join(f"const double {key}[{n}]" for key in ("q", "dq", "ddq"))
    signature = f"void {name}_torque({name}_state *state, double t, {vectors}, double tau[{n}])"
    ends = [f"    tau[{i}] = {_text(x)};" for i, x in enumerate(o.tau)]
    ends += [f"    state->memory[{k}] = {_text(x)};" for k, x in enumerate(o.memory)]
    ends += ["    state->t = t;", "    state->started = 1;"] if states else ["    (void)state;"]
    body = o.lines.needed("\n".join(ends))
    body += [f"    (void){key};" for key in ("t", "q", "dq", "ddq")]  # where a joint needs none
    if states:
        step = "state->started && t > state->t ? t - state->t : 0.0"
        body.insert(0, f"    const double dt = {step};")
    lost = [f"not in it: {cause.place}" for cause in held.causes if cause.carried == "lost"]
    about = [
        f"Inverse dynamics of {name} in SI units, with the zeros and signs of its logs.",
        "q, dq, ddq: position, speed, acceleration of each joint. tau: torque of its drive.",
        "t: seconds since the session began. state: all zero before the first call.",
        *lost,
    ]
    guard = f"{name.upper()}_H"
    header = ["/*", *(f" * {line}" for line in about), " */", f"#ifndef {guard}"]
    header += [f"#define {guard}", "", "typedef struct {", "    int started;", "    double t;"]
    header += [f"    double memory[{max(states, 1)}];", f"}} {name}_state;", "", f"{signature};"]
    source = [f'#include "{name}.h"', "#include <math.h>", "", signature, "{", *body, *ends, "}"]
    texts = {f"{name}.h": [*header, "", "#endif", ""], f"{name}.c": [*source, ""]}
    return {file: "\n".join(lines) for file, lines in texts.items()}, ()


def _name(held: Held) -> str:
    name = re.sub(r"\W", "_", held.name, flags=re.ASCII)
    return name if name[0].isalpha() else f"arm_{name}"


_DRIVER = """#include <stdio.h>
#include "NAME.h"
int main(void)
{
    NAME_state state = {0};
    double in[1 + 3 * JOINTS], tau[JOINTS];
    while (fread(in, sizeof in, 1, stdin) == 1) {
        NAME_torque(&state, in[0], in + 1, in + 1 + JOINTS, in + 1 + 2 * JOINTS, tau);
        fwrite(tau, sizeof tau, 1, stdout);
    }
    return 0;
}
"""


def _load(texts: Mapping[str, str], held: Held, motion: Motion) -> Loaded | None:
    """Return the torque of the compiled function, called once a sample in a process of its own."""
    program = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if program is None:
        return None
    n, limit, name = motion.q.shape[1], EXPORT.compile_seconds, _name(held)
    with tempfile.TemporaryDirectory() as place:
        driver = _DRIVER.replace("NAME", name).replace("JOINTS", str(n))
        for file, text in {**texts, "driver.c": driver}.items():
            (Path(place) / file).write_text(text, encoding="utf-8")
        # contraction would give other last digits on other machines
        flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-pedantic", "-ffp-contract=off"]
        command = [program, *flags, "driver.c", f"{name}.c", "-o", "a.out", "-lm"]
        done = subprocess.run(
            command, cwd=place, capture_output=True, text=True, check=False, timeout=limit
        )
        if done.returncode:
            raise RuntimeError(f"the exported C does not compile: {done.stderr}")
        rows = np.column_stack([motion.t - motion.t[0], motion.q, motion.dq, motion.ddq])
        ran = subprocess.run(
            [str(Path(place) / "a.out")], input=rows.tobytes(), check=True, capture_output=True,
            timeout=limit
        )  # fmt: skip
    version = subprocess.run([program, "--version"], capture_output=True, text=True, check=False)
    torque = np.frombuffer(ran.stdout).reshape(-1, n)
    return Loaded(version.stdout.partition("\n")[0], torque, done.stderr.strip())


C = Target(_carry, _write, _load, "a C compiler, cc", False, approximated=_APPROXIMATED)
