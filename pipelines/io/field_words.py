"""What each field of a dataclass holds, in words: the comment that stands beside it, or above it, in its source.

    words_of(LogResult)["predicted"]        "predicted: samples in which the position of some joint was not measured, …"
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import io
import textwrap
import tokenize
from functools import lru_cache
from typing import Any

from pipelines.io.result_words import WORDS

__all__ = ["words_of"]


def words_of(kind: type[Any]) -> dict[str, str]:
    """Field -> words: of its own comment, else of its name (`result_words`); "" where nobody has said anything.

    A comment goes on where the name ends, "sample_time  # [s]", so the name stands before it.
    """
    known, found = {field.name for field in dataclasses.fields(kind)}, dict[str, str]()
    for base in reversed(kind.__mro__):
        if dataclasses.is_dataclass(base):
            own = _comments(base)
            found |= {name: _words(base, name, own.get(name, "")) for name in inspect.get_annotations(base) if name in known}
    return found


def _words(kind: type[Any], name: str, comment: str) -> str:
    told = WORDS.get(f"{kind.__name__}.{name}", "")
    if not comment:
        return told or WORDS.get(name, "")
    return f"{told or name.replace('_', ' ')}: {comment}"


@lru_cache(maxsize=256)
def _comments(kind: type[Any]) -> dict[str, str]:
    """Field -> the comment on its lines, with those right above; empty where the source is not at hand."""
    try:
        source = textwrap.dedent(inspect.getsource(kind))
    except (OSError, TypeError):
        return {}
    beside, above = dict[int, str](), dict[int, str]()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            (beside if token.line[:token.start[1]].strip() else above)[token.start[0]] = token.string.lstrip("# ").strip()
    body = ast.parse(source).body[0]
    found = {}
    for node in body.body if isinstance(body, ast.ClassDef) else ():
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            first = node.lineno
            while first - 1 in above:
                first -= 1
            lines = [*(above[k] for k in range(first, node.lineno)),
                     *(beside[k] for k in range(node.lineno, (node.end_lineno or node.lineno) + 1) if k in beside)]
            found[node.target.id] = " ".join(lines)
    return found
