"""A line imports only lines below it, each library has one door, and nothing heavy is imported at start-up."""

from __future__ import annotations

import ast
import subprocess
import sys
from functools import cache
from pathlib import Path

REPO = Path(__file__).resolve().parents[1]

# The layers from the bottom up (design.md). The longest prefix that fits decides.
LAYERS = {
    "pipelines.errors": 0,
    "pipelines.io": 1,
    "pipelines.quality": 2,
    "pipelines.importers": 3,
    "pipelines.dynamics": 5,
    "pipelines.effects": 6,
    "pipelines.dynamics.arm": 6.5, "pipelines.dynamics.draw": 6.6, "pipelines.dynamics.named_cause": 6.6, "pipelines.dynamics.parameter_names": 6.5,
    "pipelines.estimation": 6.7, "pipelines.estimation.residual_analysis": 8,
    "pipelines.simulation": 6.8, "pipelines.simulation.comparison": 7.5,
    "pipelines.friction": 8.5, "pipelines.frequency": 8.5, "pipelines.writing": 9, "pipelines.excitation": 10,
    "pipelines.estimation.checks": 9,
    "pipelines.estimation.result": 10, "pipelines.diagnosis": 11,
    "pipelines.report": 12,
    "pipelines.export": 12.5,
    "pipelines.stage": 13,
    "pipelines.cache": 14,  # stored results of the stages of a run
    "pipelines": 15,
    "pipelines.selfcheck": 16,
    "pipelines.executor": 16,
    "pipelines.batch": 17,
    "pipelines.rerender": 18,
    "rrrid": 19, "rrrid_cli": 19,
}
CALL_STAGES = {"pipelines.run"}
# Of the effects, all that one of them may import.
CONTRACT = {f"pipelines.effects{end}" for end in ("", ".base", ".config", ".hooks", ".parameters")}
FILES = ("pipelines.io", "pipelines.importers")
DOORS: dict[str, str | tuple[str, ...]] = {
    "typer": "rrrid_cli", "matplotlib": ("pipelines.report", "rrrid"), "jinja2": "pipelines.report", "h5py": FILES,
    "pandas": (*FILES, "rrrid"), "pyarrow": FILES, "filterpy": "pipelines.selfcheck", "mujoco": ("bench", "pipelines.export"),
    "pinocchio": "pipelines.export", "yaml": "nobody", "pickle": "nobody", "pydantic": (*FILES, "rrrid"), "pydantic_core": FILES,
    "tomllib": "pipelines.io.sandbox",
    "rich": "rrrid_cli", "pebble": "pipelines.executor", "dask": "pipelines.executor", "distributed": "pipelines.executor",
    "psutil": "pipelines.executor", "packaging": "pipelines.selfcheck",
}
NOT_IN = {"scipy": ("pipelines.dynamics", "pipelines.simulation")}  # the equations of the arm stand on NumPy alone
CIRCLES: set[tuple[str, ...]] = set()
# What finds its modules by name: stages and effects. Any other import is written out, where the rules can see it.
BY_NAME = {"pipelines.run", "pipelines.rerender", "pipelines.executor", "pipelines.effects", "rrrid", "rrrid_cli.options"}
HEAVY = ("pandas", "matplotlib", "scipy", "filterpy", "pyarrow", "pydantic", "jinja2", "mujoco")


def _name(path: Path) -> str:
    parts = path.relative_to(REPO).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {_name(path): path for folder in ("pipelines", "rrrid", "rrrid_cli", "bench") for path in sorted((REPO / folder).rglob("*.py"))}


def _named(call: ast.Call) -> str | None:
    """The module that import_module("…") or __import__("…") imports, "?" where it is put together; None for other calls."""
    if getattr(call.func, "id", getattr(call.func, "attr", "")) not in ("import_module", "__import__"):
        return None
    first = call.args[0] if call.args else None
    return first.value if isinstance(first, ast.Constant) and isinstance(first.value, str) else "?"


@cache
def _imports(path: Path) -> set[str]:
    """Every module that `path` imports, anywhere in it, in full; "?" for one whose name is put together."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and (name := _named(node)) is not None:
            found.add(name)
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            whole = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {name if name in MODULES else str(node.module) for name in whole}
    return found


def _layer(module: str) -> int:
    if module == "pipelines":
        return 0  # the package itself holds its version and nothing else
    return max(((len(prefix), rank) for prefix, rank in LAYERS.items() if f"{module}.".startswith(f"{prefix}.")))[1]


def _toolbox(module: str) -> str:
    """The folder that a module belongs to: within one, modules may import each other."""
    return max((prefix for prefix in LAYERS if f"{module}.".startswith(f"{prefix}.")), key=len)


def _breaches(module: str, imported: set[str]) -> list[str]:
    """What of `imported` the module may not import."""
    wrong = []
    for name in imported & set(MODULES):
        if f"{module}.".startswith("bench."):
            allowed = (name.startswith(("bench", "pipelines.io", "pipelines.errors"))
                       and not (module.startswith("bench.faults.") and name.startswith("bench.faults")))
        elif name.startswith("bench"):
            allowed = False
        elif module.startswith("pipelines.effects."):
            allowed = _layer(name) < LAYERS["pipelines.effects"] or name in CONTRACT
        elif _layer(module) == LAYERS["pipelines"]:
            allowed = _layer(name) < LAYERS["pipelines"] or module in CALL_STAGES
        else:
            allowed = _layer(name) < _layer(module) or _toolbox(name) == _toolbox(module)
        wrong += [] if allowed or name == module else [f"{module} imports {name}"]
    return wrong


def test_a_line_imports_only_lines_below() -> None:
    """The import rule of design.md; stages and effects do not import each other."""
    assert [breach for module, path in MODULES.items() for breach in _breaches(module, _imports(path))] == []


def test_the_rule_can_be_broken() -> None:
    """Each kind of breach is seen: upwards, sideways between stages, between effects, out of the bench."""
    for module, imported in (("pipelines.io.files", "pipelines.dynamics.body"), ("pipelines.convert", "pipelines.inspect"),
                             ("pipelines.effects.friction", "pipelines.effects.drives"),
                             ("pipelines.dynamics.arm", "pipelines.estimation.motion"), ("bench.plant", "pipelines.dynamics.arm"),
                             ("bench.faults.load", "bench.faults.drive"),
                             ("pipelines.run", "bench"),
                             ("pipelines.report.render", "pipelines.stage")):
        assert imported in MODULES
        assert _breaches(module, {imported}) == [f"{module} imports {imported}"]


def _circles() -> set[tuple[str, ...]]:
    """The groups of modules that import each other, directly or through others."""
    graph = {module: sorted(_imports(path) & set(MODULES) - {module}) for module, path in MODULES.items()}
    reach = {module: {module} for module in graph}
    for module in graph:
        waiting = [module]
        while waiting:
            new = set(graph[waiting.pop()]) - reach[module]
            reach[module] |= new
            waiting += new
    groups = {tuple(sorted(name for name in reach[module] if module in reach[name])) for module in graph}
    return {group for group in groups if len(group) > 1}


def test_no_import_runs_in_a_circle() -> None:
    """A module can be read, and taken out, with what lies below it alone."""
    assert _circles() == CIRCLES


def test_each_library_has_one_door() -> None:
    """matplotlib only in the report, h5py and pandas only where files are read, typer and rich only in the command line, pickle
    nowhere, scipy not among the equations."""
    for module, name in ((module, name) for module, path in MODULES.items() for name in _imports(path)):
        door = DOORS.get(name.split(".")[0], f"{module}")
        doors = (door,) if isinstance(door, str) else door
        assert any(f"{module}.".startswith(f"{d}.") for d in doors), f"{module} imports {name}, whose door is {door}"
        closed = NOT_IN.get(name.split(".")[0], ())
        assert not any(f"{module}.".startswith(f"{one}.") for one in closed), f"{module} imports {name}"
        assert name != "?" or module in BY_NAME, f"{module} puts the name of a module together"


def test_importing_everything_imports_nothing_heavy() -> None:
    """Heavy libraries load inside the function that needs them, and importing a module prints and writes nothing."""
    names = [module for module in MODULES if not module.startswith("bench")]
    code = f"import sys\nfor m in {names}: __import__(m)\nprint(sorted(set({HEAVY}) & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=REPO, check=False)
    assert (done.stdout, done.stderr) == ("[]\n", "")


def test_help_imports_no_numpy() -> None:
    """`rrrid --help` needs neither NumPy nor h5py."""
    code = "import rrrid_cli.main, sys; print(sorted({'numpy', 'h5py', 'rich', 'pipelines.stage'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=REPO, check=False)
    assert done.stdout == "[]\n"
