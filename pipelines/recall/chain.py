"""The inputs of a run on their way through its stages, and all that each stage's outcome depends on."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pipelines.io.files import hash_file
from pipelines.io.places import renamed, tilde
from pipelines.io.results import encode
from pipelines.io.schema import FORMAT_VERSION
from pipelines.recall.code import code_of, libraries
from pipelines.recall.key import Key, digest_of_json
from pipelines.stage import Beside, Inputs, Stage

__all__ = ["Chain"]


class Chain:
    """The inputs on their way through the stages, and where they come from.

    What a stage that was taken back would hand on is read out of its files only when a stage after it is computed.
    """

    def __init__(self, inputs: Inputs, names: Mapping[str, str], options: Mapping[str, Any],
                 beside: Mapping[str, Beside] | None = None) -> None:
        """What it is made of.

        Args:
            names: folders of inputs -> how results name them.
            options: of the request, as far as they change what logs say.
            beside: what stages, by their names, have read beside the logs.
        """
        self.names, self.options, self.beside = names, options, beside or {}
        self.inputs = dataclasses.replace(inputs, material=None)
        self.waiting: list[tuple[Stage[Any, Any], Any, Path]] = []
        self.through: dict[str, str] = {}
        self.upon: dict[str, str] = {}

    def key(self, stage: Stage[Any, Any], settings: Any) -> Key:
        """All that the outcome of `stage` depends on."""
        logs = [opened for opened in self.inputs.logs if stage.uses.logs(opened.log, settings)]
        others = {f"{o.log.experiment} ({o.log.role}, {o.log.origin})" for o in self.inputs.logs} if len(
            logs) < len(self.inputs.logs) else set()
        unusable = {self._name(one.path): digest_of_json(renamed(one.error.as_dict(), self.names))
                    for one in self.inputs.rejected} if stage.uses.rejected else {}
        return Key(stage.name, tilde(encode(settings)[0]), {self._name(o.path): o.sha256 for o in logs}, tuple(sorted(others)),
                   unusable, self.options, code_of(stage.compute.__module__, ("pipelines.report",)), libraries(),
                   f"log {FORMAT_VERSION}", self.through, self.upon if stage.uses.before else {},
                   {self._name(path): hash_file(path) for path in self._beside(stage).sources})

    def _beside(self, stage: Stage[Any, Any]) -> Beside:
        return self.beside.get(stage.name, Beside())

    def _name(self, path: Path) -> str:
        return str(renamed(str(path), self.names))

    def inputs_of(self, stage: Stage[Any, Any]) -> Inputs:
        """What `stage` gets: of what came before, no more than it says that it uses."""
        for earlier, result, files in self.waiting:
            self.inputs = earlier.onward(earlier.restored(result, files) if earlier.restored else result, self.inputs)
        self.waiting = []
        uses = stage.uses
        material = self.inputs.material if uses.before else self._beside(stage).material
        return dataclasses.replace(self.inputs, material=material,
                                   rejected=self.inputs.rejected if uses.rejected else ())

    def passed(self, stage: Stage[Any, Any], key: Key, result: Any) -> None:
        """`stage` was computed; None where it had no result."""
        if result is not None:
            self.inputs = stage.onward(result, self.inputs)
        self._handed(stage, key)

    def taken_back(self, stage: Stage[Any, Any], key: Key, result: Any, files: Path) -> None:
        """`stage` was not computed; its files lie in `files`."""
        if result is not None and stage.hands_on:
            if stage.hands_on == "choice" and not self.waiting:
                self.inputs = stage.onward(result, self.inputs)
            else:
                self.waiting.append((stage, result, files))
        self._handed(stage, key)

    def _handed(self, stage: Stage[Any, Any], key: Key) -> None:
        if stage.hands_on == "logs":
            self.through = self.through | {stage.name: key.treatment}
        if stage.hands_on == "material":
            self.upon = {stage.name: key.digest}
