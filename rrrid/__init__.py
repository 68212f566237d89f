"""Identify robot arms from logs of experiments: the stages of the command line as functions.

    import rrrid

    logs = rrrid.load("sample_logs/rrr-changed")
    friction = rrrid.fit_friction(logs)
    model = rrrid.estimate(friction)
    found = rrrid.diagnose(model)
    folder = rrrid.extend(found).save("runs/extended")
    rrrid.export(folder / "model.json", to="urdf").save("runs/urdf")

Each function takes what `load` or another function returned, and hands on to the next one what
`rrrid run` would: logs that can be used, friction laws, the model, the causes. Options are those of
the command, by the names of its `Settings`. All of them return an `Answer`.

Raises everywhere: `rrrid.RrridError` with a stable code, a place and a remedy.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from pipelines.errors import RrridError, UsageError, did_you_mean

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from pipelines.design_excitation import Result as Design
    from pipelines.diagnose import Result as Diagnosis
    from pipelines.diagnosis.result import Extension
    from pipelines.errors import Check
    from pipelines.estimate_bps import Result as Estimate
    from pipelines.export.card import Card
    from pipelines.fit_friction import Result as Friction
    from pipelines.frf import Result as Responses
    from pipelines.inspect import Result as Examination
    from pipelines.io.log import ExperimentLog
    from pipelines.reconstruct import Result as Motion
    from pipelines.report.report import Figure as Drawing
    from pipelines.simulate import Result as Simulation
    from pipelines.stage import Answer as Found
    from pipelines.validate_writing import Result as Validation

__all__ = [
    "Answer",
    "RrridError",
    "design",
    "diagnose",
    "estimate",
    "export",
    "extend",
    "fit_friction",
    "frf",
    "load",
    "reconstruct",
    "simulate",
    "validate",
]

R = TypeVar("R")

# The field of each result that `to_frame` makes a table of.
_ROWS = {
    "inspect": "logs",
    "fit-friction": "joints",
    "reconstruct": "logs",
    "estimate-bps": "parameters",
    "validate-writing": "logs",
    "frf": "classification",
    "diagnose": "findings",
    "extend": "findings",
    "simulate": "logs",
    "design-excitation": "parameters",
}
_ROLES = {"identify", "validate", "reference"}


@dataclass(frozen=True, eq=False, repr=False)
class Answer(Generic[R]):
    """Result of a stage, with its inputs and its report; `save` writes it."""

    found: Found[Any, R]

    @property
    def result(self) -> R:
        """The frozen dataclass that the stage's `result.json` holds; SI units."""
        return self.found.result

    @property
    def summary(self) -> str:
        """The verdict in one line."""
        return self.found.report.verdict.replace("\n", " ")

    @property
    def logs(self) -> tuple[ExperimentLog, ...]:
        """The logs that were used."""
        return tuple(opened.log for opened in self.found.inputs.logs)

    @property
    def checks(self) -> tuple[Check, ...]:
        """Findings and repairs in the inputs, each with its code and a remedy."""
        return self.found.checks

    @property
    def figures(self) -> tuple[str, ...]:
        """Names of the figures of the report, for `plot`."""
        return tuple(one.name for one in self._drawings())

    def _drawings(self) -> list[Drawing]:
        from pipelines.report.report import figures_in

        return list(figures_in(self.found.report.sections))

    def to_frame(self, rows: str = "") -> pandas.DataFrame:
        """Return the rows of the result as a table, a column a number or text.

        Args:
            rows: the field of the result that has them: "findings". Default: the main one.

        Raises:
            UsageError: C02, the result has no rows of that name.
        """
        import pandas

        from pipelines.io.results import encode

        object_, name = encode(self.result)[0], rows or _ROWS[self.found.stage.name]
        lists = [key for key, value in object_.items() if isinstance(value, list)]
        if name not in lists:
            words = f"the result of {self.found.stage.name} has no rows '{name}'"
            raise UsageError("C02", words, "to_frame", f"there are: {', '.join(lists)}")
        return pandas.json_normalize(object_[name])

    def plot(self, name: str = "") -> Figure:
        """Return a figure of the report.

        Args:
            name: one of `figures`; default: the first.

        Raises:
            UsageError: C02, there is no such figure.
        """
        from io import BytesIO

        from matplotlib.figure import Figure

        class Drawing(Figure):
            def _repr_png_(self) -> bytes:  # what a notebook shows
                picture = BytesIO()
                self.savefig(picture, format="png")
                return picture.getvalue()

        for one in self._drawings():
            if name in ("", one.name):
                drawing = Drawing(figsize=one.size, layout="constrained")
                one.draw(drawing)
                return drawing
        there = ", ".join(self.figures) or "none"
        raise UsageError("C02", f"no figure '{name}'", "plot", f"there are: {there}")

    def save(self, folder: str | Path, *, force: bool = False) -> Path:
        """Write what the command writes: results, report, figures, models, derived logs.

        Args:
            force: replace a folder of another command, or one that was changed since.

        Raises:
            EnvironmentFault: the folder cannot be written; an old one is untouched.
            UsageError: the folder holds something else.
        """
        from pipelines.stage import usable_folder

        out, found = Path(folder), self.found
        request = replace(found.request, force=force)
        usable_folder(out, found.stage, request, found.inputs, found.hashes)
        found.write(out)
        return out

    def __repr__(self) -> str:
        return f"<{self.found.stage.name}: {self.summary}>"

    def _repr_html_(self) -> str:
        """Return the verdict, the checks and the key figures for a notebook."""
        from pipelines.report.render import in_short

        return in_short(self.found.report, self.checks)


def load(
    paths: str | Path | Sequence[str | Path],
    *,
    robot: str | None = None,
    session: str = "",
    joints: Sequence[int] = (),
    roles: Mapping[str, str | Path | Sequence[str | Path]] | None = None,
) -> Answer[Examination]:
    """Read logs, and examine what they can be used for.

    Args:
        paths: logs (.h5, .parquet), folders of them, or patterns.
        robot: description to use instead of the one in the logs: file, URDF or shipped name.
        session: the one to take, where a folder holds several robots or days.
        joints: the joints to take, from 1, in this order; default all.
        roles: paths of logs by the role they have instead of their own: {"reference": ["before/"]}.

    Returns:
        What is in them and what is wrong with them; those that can be used are handed on.

    Raises:
        NothingMatched: C06, there is no log.
        InputRejected: no log can be read.
    """
    from pipelines.inspect import STAGE, Settings
    from pipelines.io.files import expanded
    from pipelines.io.schema import ROLES
    from pipelines.io.sessions import of_one_session
    from pipelines.stage import Request, answered, read_logs, robot_hashes

    started, by_role = time.time(), {role: _listed(own) for role, own in (roles or {}).items()}
    for role in set(by_role).difference(ROLES):
        words = f"no role '{role}'{did_you_mean(role, ROLES)}"
        raise UsageError("C02", words, "load", f"there are: {', '.join(ROLES)}")
    where = expanded(Path(one).expanduser().absolute() for one in _listed(paths))
    request = Request(where, robot=robot, session=session, joints=tuple(joints), roles=by_role)
    described = robot_hashes(request)
    inputs = of_one_session(read_logs(request, Settings(), keep_rejected=True))
    return Answer(answered(STAGE, request, Settings(), inputs, described, started))


def _listed(paths: str | Path | Sequence[str | Path]) -> list[str]:
    given = [paths] if isinstance(paths, str | Path) else paths
    if not isinstance(given, Sequence) or not all(isinstance(x, str | Path) for x in given):
        words = f"{paths!r} names no logs"
        raise UsageError("C02", words, "load", "give a path, or a list of paths")
    return [str(one) for one in given]


def fit_friction(given: Answer[Any], **options: Any) -> Answer[Friction]:
    """Fit the friction law of each joint (Kostić et al. 2004, eq. 7)."""
    return _next("fit_friction", given, options)


def reconstruct(given: Answer[Any], **options: Any) -> Answer[Motion]:
    """Reconstruct position, speed and acceleration by a Kalman observer (eq. 21)."""
    return _next("reconstruct", given, options)


def estimate(given: Answer[Any], **options: Any) -> Answer[Estimate]:
    """Estimate the base parameters by least squares (eq. 12-15), each with its std."""
    return _next("estimate_bps", given, options)


def validate(given: Answer[Any], **options: Any) -> Answer[Validation]:
    """Compare a model with logs of the writing task (Section IV)."""
    return _next("validate_writing", given, options)


def frf(given: Answer[Any], **options: Any) -> Answer[Responses]:
    """Measure frequency responses, and classify compliance (Section V)."""
    return _next("frf", given, options)


def diagnose(given: Answer[Any], **options: Any) -> Answer[Diagnosis]:
    """Find what the simulation gets wrong, name the cause, and measure the gain."""
    return _next("diagnose", given, options)


def extend(given: Answer[Any], *causes: str, **options: Any) -> Answer[Extension]:
    """Extend the model by causes, as far as held-out logs bear them out.

    Args:
        causes: "cogging:2"; default: those that `diagnose` found.
    """
    return _next("extend", given, options | ({"causes": causes} if causes else {}))


def simulate(given: Answer[Any], model: str | Path, **options: Any) -> Answer[Simulation]:
    """Simulate a model in the experiments of logs.

    Args:
        model: a model.json, as `save` of `estimate` writes it, or a shipped name.
    """
    return _next("simulate", given, options | {"model": str(model)})


def design(robot: str | Path | None = None, **options: Any) -> Answer[Design]:
    """Design an experiment for a robot.

    Args:
        robot: description, URDF, log or shipped name.
    """
    from pipelines.design_excitation import STAGE, Settings, read
    from pipelines.stage import Request, answered

    named = {"robot": None if robot is None else str(robot)}
    settings = _settings(Settings(), options | named, "design")
    request, started = Request(()), time.time()
    return Answer(answered(STAGE, request, settings, read(request, settings), {}, started))


def export(model: str | Path, to: str) -> Answer[Card]:
    """Bring a model into the format of another program, with a proof of what it carries.

    Args:
        model: a model.json, as `save` of `estimate` or `extend` writes it.
        to: "urdf", "mjcf", "c" or "json".
    """
    from pipelines.export_model import STAGE, Settings, read
    from pipelines.stage import Request, answered

    settings = _settings(Settings(), {"model": str(model), "to": to}, "export")
    request, started = Request(()), time.time()
    return Answer(answered(STAGE, request, settings, read(request, settings), {}, started))


def _next(module: str, given: Answer[Any], options: dict[str, Any]) -> Answer[Any]:
    """Return the answer of a stage to what another one hands on."""
    from pipelines.stage import Stage, answered, handed_on

    if not isinstance(given, Answer):
        words, remedy = f"{given!r} is no answer", "read the logs first: rrrid.load(paths)"
        raise UsageError("C02", words, module, remedy)
    if roles := _ROLES.intersection(options):
        remedy = "name them when the logs are read: load(paths, roles={...})"
        raise UsageError("C02", f"logs of role {min(roles)}", module, remedy)
    stage: Stage[Any, Any] = import_module(f"pipelines.{module}").STAGE
    settings = _settings(stage.in_run or stage.settings(), options, stage.name)
    started, before = time.time(), given.found
    inputs = handed_on(before, stage, settings, anew="model" in options)
    return Answer(answered(stage, before.request, settings, inputs, before.hashes, started))


def _settings(usual: Any, options: dict[str, Any], where: str) -> Any:
    """Return settings with some of them changed.

    Raises:
        UsageError: C01, there is no such option; C02, a value that it cannot have.
    """
    from pydantic import TypeAdapter, ValidationError

    names = [one.name for one in fields(usual)]
    for name in options:
        if name not in names:
            words = f"no option '{name}'{did_you_mean(name, names)}"
            raise UsageError("C01", words, where, f"there are: {', '.join(names)}")
    kept = {name: getattr(usual, name) for name in names}
    try:
        return TypeAdapter(type(usual)).validate_python(kept | options)
    except ValidationError as problem:
        first = problem.errors()[0]
        place = ".".join(map(str, first["loc"]))
        words = f"{place}: {first['msg'].lower()}"
        raise UsageError("C02", words, where, "see the help of the command") from None
