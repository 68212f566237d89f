"""Find the robots, recipes and models that come with rrrid by their bare names."""

from __future__ import annotations

from pathlib import Path

from pipelines.errors import UsageError, did_you_mean

__all__ = ["shipped", "shipped_names"]

# In a wheel the files lie inside the package; in a checkout (and an editable install) in sample_logs/.
_ROOTS = (Path(__file__).resolve().parents[1] / "shipped", Path(__file__).resolve().parents[2] / "sample_logs")
_ENDINGS = {"robots": ".toml", "recipes": ".toml", "models": ".json"}


def shipped_names(kind: str) -> list[str]:
    """Names of what is shipped of `kind` ("robots", "recipes" or "models"), sorted."""
    return sorted({path.stem for root in _ROOTS for path in (root / kind).glob(f"*{_ENDINGS[kind]}")})


def shipped(kind: str, name: str) -> Path:
    """The file of the shipped robot, recipe or model `name`.

    Raises:
        UsageError: nothing of that name is shipped, and no such file exists.
    """
    known = shipped_names(kind)
    if name in known:
        return next(path for root in _ROOTS if (path := root / kind / f"{name}{_ENDINGS[kind]}").is_file())
    raise UsageError("C04", f"no such file, and no shipped {kind[:-1]} of that name{did_you_mean(name, known)}",
                     where=name, remedy=f"shipped {kind}: {', '.join(known) or 'none'}")
