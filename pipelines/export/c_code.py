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
        for acting in reversed(arm.effects):
            if acting.effect.name in _ENCODERS:
                _ENCODERS[acting.effect.name](self, acting, self._joint(acting), acting.values)
        self.rigid = self._rigid()
        self.tau = np.array([0.0] * len(self.q), dtype=object)
        self.friction: _Vector = None  # of all laws, known when effects come
        for law in arm.friction:  # they see the rigid body, not each other
            self._load(law)
        self.friction, self.tau = self.tau.copy(), self.rigid + self.tau
        for acting in arm.effects:
            if acting.effect.name not in _ENCODERS:
                self._load(acting)

    @staticmethod
    def _joint(acting: Acting) -> int:
        return (acting.effect.joint or 1) - 1

    def _load(self, acting: Acting) -> None:
        """Add what a cause makes of the torque so far."""
        effect, values, j = acting.effect, acting.values, self._joint(acting)
        if effect.name in _LOADS:
            _LOADS[effect.name](self, acting, j, values)
        elif (curve := effect.speed_curve(values)) is not None:
            self.tau[j] += curve.of(self.v[j], self.m)
        elif (load := effect.own_load(values)) is not None:
            self.tau[j] += load(self.q[j], self.v[j], self.m)
        elif (own := effect.own_memory(values)) is not None:
            step = self.lines.value("dt")
            now = self.lines.value(f"state->memory[{len(self.memory)}]")
            half = now + 0.5 * step * own.rate(now, self.v[j], self.m)
            bound = 1.0 + values.get("breakaway", 0.0)  # as far as it can bend
            then = self.m.smaller(now + step * own.rate(half, self.v[j], self.m), bound)
            then = self.m.larger(then, -bound)
            self.memory.append(then)
            self.tau[j] += own.load(then, own.rate(then, self.v[j], self.m))

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


_Values = Mapping[str, float]
_Writer = Callable[[_Program, Acting, int, _Values], None]


def _load_friction(o: _Program, acting: Acting, j: int, values: _Values) -> None:
    """µ |τ_l| tanh(w v) / (1 - i µ c), as in `LoadFriction`; a law of friction knows no i."""
    side, load, lost = o.m.tanh(values["sharpness"] * o.v[j]), o.rigid[j], 1.0
    if o.friction is not None:
        load = o.tau[j] - (1.0 - values["behind"]) * o.friction[j]
        into = values["input_side"] * values["mu"]
        lost = 1.0 - into * (o.m.sign(load) * side) if into else 1.0
    o.tau[j] += values["mu"] * abs(load) * side / lost


def _rotor(o: _Program, acting: Acting, j: int, values: _Values) -> None:
    o.tau[j] += values["inertia"] * o.a[j]


def _coupling(o: _Program, acting: Acting, j: int, values: _Values) -> None:
    """J ds/dt + B s + C tanh(w s), s = v_j + ρ v_i, on both joints."""
    i = int(values["with_joint"]) - 1
    unit = acting.effect.simulate(o.held.arm, {**values, "inertia": 1.0}).inertia
    ratio = 1.0 if unit is None else float(unit[j, i])
    s, ds = o.v[j] + ratio * o.v[i], o.a[j] + ratio * o.a[i]
    torque = values["inertia"] * ds + values["viscous"] * s
    torque += values["coulomb"] * o.m.tanh(values["sharpness"] * s)
    o.tau[j] += torque
    o.tau[i] += ratio * torque


def _drift(o: _Program, acting: Acting, j: int, values: _Values) -> None:
    """r Fv (1 - e^(-t/T)) v, t since the session began."""
    change = acting.effect.curve(np.array([1.0]), o.held.arm.nominal, values).item()
    grown = 1.0 - o.m.exp(o.m.larger(o.t, 0.0) * (-1.0 / values["time_constant"]))
    o.tau[j] += change * grown * o.v[j]


def _gain(o: _Program, acting: Acting, j: int, values: _Values) -> None:
    o.tau[j] = o.tau[j] / (1.0 + values["gain_error"])


def _torque_crosstalk(o: _Program, acting: Acting, j: int, values: _Values) -> None:
    o.tau[j] += values["coefficient"] * o.tau[int(values["from_joint"]) - 1]


def _saturation(o: _Program, acting: Acting, j: int, values: _Values) -> None:
    inside = o.m.smaller(o.m.larger(o.tau[j], -values["limit"]), values["limit"])
    o.tau[j] += values["coefficient"] * (o.tau[j] - inside)


def _eccentric(o: _Program, acting: Acting, j: int, values: _Values) -> None:
    """q_measured = q + A sin(q + φ), solved for q; speed and acceleration with it."""
    size, phase, read = values["amplitude"], values["phase"], o.q[j]
    for _ in range(_ROUNDS):
        o.q[j] = read - size * o.m.sin(o.q[j] + phase)
    slope = 1.0 + size * o.m.cos(o.q[j] + phase)
    o.v[j] = o.v[j] / slope
    o.a[j] = (o.a[j] + size * o.m.sin(o.q[j] + phase) * o.v[j] * o.v[j]) / slope


def _encoder_crosstalk(o: _Program, acting: Acting, j: int, values: _Values) -> None:
    """q_j = q_measured,j - c q_i."""
    for state in (o.q, o.v, o.a):
        state[j] -= values["coefficient"] * state[int(values["from_joint"]) - 1]


def _delay(o: _Program, acting: Acting, j: int, values: _Values) -> None:
    """q(t) = q_measured(t + Δ) to second order: the jerk is not known."""
    by = values["delay"]
    o.q[j] += by * (o.v[j] + 0.5 * by * o.a[j])
    o.v[j] += by * o.a[j]


_LOADS: dict[str, _Writer] = {
    "load_friction": _load_friction,
    "rotor_inertia": _rotor,
    "viscous_drift": _drift,
    "transmission_coupling": _coupling,
    "torque_gain": _gain,
    "torque_crosstalk": _torque_crosstalk,
    "torque_saturation": _saturation,
}
_ENCODERS: dict[str, _Writer] = {
    "encoder_eccentricity": _eccentric,
    "encoder_crosstalk": _encoder_crosstalk,
    "time_delay": _delay,
}


def _carry(acting: Acting) -> Acting | None:
    """Return a cause that the C function has."""
    effect, values = acting.effect, acting.values
    if effect.name in _LOADS or effect.name in _ENCODERS:
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
    ends += ["    state->t = t;"] if states else ["    (void)state;"]
    body = o.lines.needed("\n".join(ends))
    body += [f"    (void){key};" for key in ("t", "q", "dq", "ddq")]  # where a joint needs none
    if states:
        body.insert(0, "    const double dt = t > state->t ? t - state->t : 0.0;")
    lost = [f"not in it: {cause.place}" for cause in held.causes if cause.carried == "lost"]
    about = [
        f"Inverse dynamics of {name} in SI units, with the zeros and signs of its logs.",
        "q, dq, ddq: position, speed, acceleration of each joint. tau: torque of its drive.",
        "t: seconds since the session began. state: all zero before the first call.",
        *lost,
    ]
    guard = f"{name.upper()}_H"
    header = ["/*", *(f" * {line}" for line in about), " */", f"#ifndef {guard}"]
    header += [f"#define {guard}", "", "typedef struct {", "    double t;"]
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
