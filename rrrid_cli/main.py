"""The console script: call the command, and end with one line and an exit code in every case."""

from __future__ import annotations

import atexit
import gc
import os
import re
import signal
import sys
import traceback
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn, TextIO

import typer

from pipelines.errors import Interrupted, RrridError, UsageError, did_you_mean
from pipelines.io.output import fault_of, renamed
from rrrid_cli.app import build
from rrrid_cli.console import print_error
from rrrid_cli.options import RENAMED

_SIGNALS = (signal.SIGTERM, signal.SIGINT)


def economise() -> None:
    """Use one BLAS thread, and search for cycles rarely: of half a second that takes a tenth."""
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # many small solves are 5 to 10 times slower with more
    gc.set_threshold(100_000, 20, 20)
    atexit.register(gc.freeze)


def entry() -> NoReturn:
    """Run the program: an error becomes one line and an exit code, with --debug a traceback."""
    economise()
    heard: list[int] = []

    def interrupt(number: int, _frame: FrameType | None) -> NoReturn:
        heard.append(number)
        raise Interrupted(number)

    for number in _SIGNALS:
        signal.signal(number, interrupt)
    sys.unraisablehook = _raise_again
    words = sys.argv[1:]
    as_json = "--json" in words
    _prepare_streams(as_json)
    try:
        code = _exit_code(words)
    except BrokenPipeError:  # the reader of a pipe has left: without a second complaint at exit
        _discard(sys.stdout, sys.stderr)
        code = 0
    except (Exception, Interrupted) as caught:
        _ignore_signals()
        if "--debug" in words:
            traceback.print_exc()
        # a library in whose call the signal came may have made another error of it
        error = Interrupted(heard[0]).as_error() if heard else _as_error(caught, words)
        code = error.exit_code
        _print_error(error, as_json)
        if heard:
            _leave(code)
    _ignore_signals()
    sys.exit(code)


def _exit_code(words: Sequence[str]) -> int:
    """Return the exit code of a command, when all that it prints has been taken."""
    code = 0
    try:
        call(words)
    except typer.Exit as ended:
        code = ended.exit_code
    sys.stdout.flush()
    return code


def call(words: Sequence[str]) -> None:
    """Parse and run; typer's own way of ending has other words for errors, and 1 for Ctrl-C.

    Raises:
        typer.Exit: done, with the exit code.
        UsageError: C01, an unknown option or command; C02, an argument is missing or wrong.
    """
    if "_RRRID_COMPLETE" in os.environ:  # a shell asks how the line could go on
        line = os.environ.get("COMP_WORDS", "") or os.environ.get("_TYPER_COMPLETE_ARGS", "")
        build("".join(line.split()[1:2]))(prog_name="rrrid", complete_var="_RRRID_COMPLETE")
    command = typer.main.get_command(build(words[0] if words else ""))
    try:
        with command.make_context("rrrid", list(words)) as context:
            command.invoke(context)
    except typer.TyperException as problem:
        if not words:  # `rrrid` alone: the help
            print(problem.format_message(), file=sys.stderr)
            raise typer.Exit(2) from None
        raise _usage_error(problem, f"rrrid {words[0]}") from None


def _usage_error(problem: typer.TyperException, called: str) -> UsageError:
    """Return typer's complaint in rrrid's words.

    Args:
        called: the command, where typer does not say whose option it is.
    """
    context: Any = getattr(problem, "ctx", None)
    where = context.command_path if context is not None else called
    text, code = problem.format_message().splitlines()[0].rstrip("."), "C02"
    if found := re.match(r"No such (option|command):? '?([^' ]+)", text):
        known = list(getattr(context.command, "commands", {}))
        if found[1] == "option":
            known = [name for one in context.command.get_params(context) for name in one.opts]
        now = RENAMED.get(found[2], "")
        hint = f", it is {now} now" if now in known else did_you_mean(found[2], known)
        text, code = f"no such {found[1]} '{found[2]}'{hint}", "C01"
    return UsageError(code, f"{text[0].lower()}{text[1:]}", where, f"see '{where} --help'")


def _as_error(problem: BaseException, words: Iterable[str]) -> RrridError:
    """Return what ended a command as an error with a code, a place and a remedy."""
    if isinstance(problem, OSError):
        problem = fault_of(problem, Path("standard output"))
    if not isinstance(problem, RrridError):
        return _internal(problem)
    # absolute paths, as stages have them -> as the command line has them
    names: dict[str, str] = {}
    with suppress(FileNotFoundError):  # a working folder that is gone
        for text in (part for word in words for part in (word, word.partition("=")[2])):
            path = Path(text)
            if text and not text.startswith("-") and not path.is_absolute():
                for one in (path, *(above for above in path.parents if above != Path())):
                    names.setdefault(os.path.abspath(one), str(one))
    for each in (problem, *problem.others):
        each.where, each.message = renamed(each.where, names), renamed(each.message, names)
        each.remedy = renamed(each.remedy, names)
    return problem


def _internal(problem: BaseException) -> RrridError:
    """Return an error of rrrid's own: the traceback goes to a file, the user gets one line."""
    import tempfile
    import traceback

    handle, name = tempfile.mkstemp(prefix="rrrid-crash-", suffix=".txt")
    with open(handle, "w", encoding="utf-8", errors="replace") as file:
        file.write(f"{' '.join(sys.argv)}\n\n")
        traceback.print_exception(problem, file=file)
    words = f"internal error: {type(problem).__name__}: {problem}"
    return RrridError("Z70", words, remedy=f"please report it with {name}")


def _print_error(error: RrridError, as_json: bool) -> None:
    """Print an error on each stream that takes it; the exit code says it in any case."""
    try:
        print_error(error)
    except OSError:
        _discard(sys.stderr)
    try:
        if as_json:
            from pipelines.io.results import json_text

            told: dict[str, Any] = {"error": error.as_dict(), "exit": error.exit_code}
            if error.others:
                told["others"] = [other.as_dict() for other in error.others]
            sys.stdout.write(json_text(told))
        sys.stdout.flush()
    except OSError:
        _discard(sys.stdout)


def _discard(*streams: TextIO) -> None:
    """Discard further output: the reader of the pipe has left, or the disk is full."""
    for stream in streams:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _ignore_signals() -> None:
    """Let no signal end the last words in a traceback."""
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def _leave(exit_code: int) -> NoReturn:
    """End at once: after a signal inside a C library the interpreter may not be able to end."""
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError):
            stream.flush()
    os._exit(exit_code)


def _raise_again(lost: Any) -> None:
    """Send a signal once more that came where Python can raise nothing: in a destructor, say."""
    if isinstance(lost.exc_value, Interrupted):
        import threading

        threading.Timer(0.01, os.kill, (os.getpid(), lost.exc_value.exit_code - 128)).start()
    elif "h5py" not in str(lost.object):  # a full disk, after the error that was printed
        sys.__unraisablehook__(lost)


def _prepare_streams(as_json: bool) -> None:
    """Open a closed standard stream on the null device, and let no character fail."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            null = os.open(os.devnull, os.O_RDWR)
            if null != number:  # a later file must not take the number
                os.dup2(null, number)
            mode = "r" if number == 0 else "w"
            setattr(sys, name, open(number, mode, encoding="utf-8"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if (configure := getattr(stream, "reconfigure", None)) is not None:
            configure(errors="replace")
            if as_json and stream is sys.stdout:
                configure(encoding="utf-8")


if __name__ == "__main__":
    entry()
