"""What a batch does with each item: a stage, its settings and options, as one text that any process can work from.

    plan = Plan("pipelines.inspect", settings, …)
    again = read_plan(plan_text(plan))        in a worker, here or on another machine
    key = plan_key(plan)                      changes with everything that can change an item's result, its logs apart
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from importlib import import_module
from typing import Any, Final

from pipelines.errors import UsageError, did_you_mean
from pipelines.io.files import hash_file
from pipelines.io.results import decode, encode
from pipelines.io.robot_files import robot_sources
from pipelines.recall.code import code_of, libraries
from pipelines.recall.key import digest_of_json
from pipelines.stage import Stage

__all__ = ["STAGES", "Options", "Plan", "load_stage", "module_of", "plan_key", "plan_text", "read_plan"]

# The commands that read a folder of logs and nothing else.
STAGES: Final = ("run", "inspect", "convert", "fit-friction", "reconstruct", "estimate-bps", "simulate", "validate-writing", "frf",
                 "diagnose", "extend")
_LIBRARIES = ("numpy", "scipy", "h5py", "pyarrow", "pandas", "matplotlib", "filterpy", "jinja2")


@dataclass(frozen=True)
class Options:
    """What holds for every item, beside the stage's own settings."""

    robot: str | None = None
    strict: bool = False
    force: bool = False
    no_report: bool = False
    assume_units: bool = False
    format: str = "h5"
    joints: tuple[int, ...] = ()
    memory: int | None = None  # [B] that one item may use beyond what a worker has anyway
    timeout: float | None = None  # [s] for one item


@dataclass(frozen=True)
class Plan:
    """One stage with all that it needs to know beforehand."""

    module: str  # of the stage: "pipelines.inspect"
    settings: Any  # the stage's own
    options: Options = Options()
    root: str = ""  # absolute; items are named relative to it
    out: str = ""  # absolute; each item's folder stands below it
    folder: str = ""  # where relative paths of the settings begin

    @property
    def stage(self) -> str:
        return load_stage(self.module).name


def module_of(stage: str) -> str:
    """The module of a stage by its command's name.

    Raises:
        UsageError: C01, it is none that a batch can run.
    """
    if stage not in STAGES:
        raise UsageError("C01", f"'{stage}' is no stage of a batch{did_you_mean(stage, STAGES)}", where="--stage",
                         remedy=f"one of: {', '.join(STAGES)}")
    return f"pipelines.{stage.replace('-', '_')}"


def load_stage(module: str) -> Stage[Any, Any]:
    stage: Stage[Any, Any] = import_module(module).STAGE
    return stage


def plan_text(plan: Plan) -> str:
    """The plan as JSON.

    Raises:
        UsageError: C02, a setting does not survive it.
    """
    text = json.dumps({"module": plan.module, "settings": encode(plan.settings)[0], "options": asdict(plan.options),
                       "root": plan.root, "out": plan.out, "folder": plan.folder}, sort_keys=True)
    if read_plan(text) != plan:
        raise UsageError("C02", "these settings cannot be handed to other processes", where=plan.stage,
                         remedy="leave infinite values and arrays out")
    return text


def read_plan(text: str) -> Plan:
    """The plan that `plan_text` made `text` of."""
    about = json.loads(text)
    options = Options(**(about["options"] | {"joints": tuple(about["options"]["joints"])}))
    return Plan(about["module"], _settings(about["module"], about["settings"]), options,
                about["root"], about["out"], about["folder"])


def _settings(module: str, values: dict[str, Any]) -> Any:
    """The settings of a stage; those of `run` hold settings of the stages it runs, by their names."""
    settings = decode(load_stage(module).settings, values, {})
    if "stages" in values:
        inner = {name: _settings(module_of(name), item) for name, item in values["stages"].items()}
        return type(settings)(**{**{name: getattr(settings, name) for name in values}, "stages": inner})
    return settings


def plan_key(plan: Plan) -> str:
    """SHA-256 of all that decides on an item's result beside its logs: settings, options, code, libraries, the given robot."""
    about = json.loads(plan_text(plan))
    for name in ("memory", "timeout", "force"):  # they decide whether there is a result, not which
        del about["options"][name]
    for name in ("root", "out", "folder"):  # where things lie decides nothing
        del about[name]
    sources = robot_sources(plan.options.robot) if plan.options.robot is not None else ()
    robot = [hash_file(path) for path in sources if path.is_file()]
    return digest_of_json([about, robot, _code(plan.module), libraries(_LIBRARIES)])


def _code(module: str) -> dict[str, dict[str, str]]:
    """The hashes of the code that a stage consists of; of `run` the code of every stage."""
    modules = [module_of(name) for name in STAGES] if module == "pipelines.run" else [module]
    return {name: code_of(name) for name in modules}
