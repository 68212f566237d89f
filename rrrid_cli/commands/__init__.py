"""One command per stage: parse, call, print. `rrrid_cli.main` starts them.

Each file holds the commands of one kind. Heavy modules are imported inside the commands: `rrrid --help` answers at once.
"""

from __future__ import annotations

from rrrid_cli.commands import causes, designing, estimating, judging, logs, tools, workflow
from rrrid_cli.commands.application import STAGES, app

__all__ = ["STAGES", "app", "causes", "designing", "estimating", "judging", "logs", "tools", "workflow"]
