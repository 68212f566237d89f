"""The console script: call the command, and end with one line and an exit code in every case."""

from __future__ import annotations

import atexit
import copy
import os
import signal
import sys
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn, TextIO

import typer

from pipelines.batch.process import economise
from pipelines.errors import EnvironmentFault, Interrupted, RrridError
from pipelines.io.atomic import fault_of
from rrrid_cli.commands import app
from rrrid_cli.console import say_error, say_error_object
from rrrid_cli.streams import prepare_streams
from rrrid_cli.usage import WrongUsage, as_error, as_given

__all__ = ["entry"]


def _interrupt(number: int, _frame: FrameType | None) -> NoReturn:
    raise Interrupted(number)


def entry() -> NoReturn:
    """The console script: every error becomes one line and an exit code; a traceback only with --debug."""
    economise()
    signal.signal(signal.SIGTERM, _interrupt)
    signal.signal(signal.SIGINT, _interrupt)
    sys.unraisablehook = _again
    as_json, debug = "--json" in sys.argv, "--debug" in sys.argv
    prepare_streams(as_json)
    try:
        if "_RRRID_COMPLETE" in os.environ:  # a shell asks how the line could go on
            app(prog_name="rrrid", complete_var="_RRRID_COMPLETE")
        code = _ended(sys.argv[1:])
    except (RrridError, Interrupted) as problem:
        _deaf()
        if debug:
            raise
        error = problem.as_error() if isinstance(problem, Interrupted) else as_given(_no_folder(problem), sys.argv[1:])
        _say(error, as_json)
        if isinstance(problem, Interrupted):
            _leave(error.exit_code)
        sys.exit(error.exit_code)
    except BrokenPipeError:
        # The reader of a pipe has left; what is still buffered goes nowhere, without a second complaint at exit.
        _mute()
        sys.exit(0)
    except OSError as problem:
        if debug:
            raise
        fault = _no_folder(fault_of(problem, Path("standard output")))
        _say(fault, as_json=False)
        _mute()
        sys.exit(fault.exit_code)
    except Exception as problem:
        if debug:
            raise
        _say(_internal(problem), as_json)
        sys.exit(70)
    _deaf()
    sys.exit(code)


def _ended(words: list[str]) -> int:
    """The exit code of a command, when all that it prints has been taken."""
    try:
        _call(words)
        code = 0
    except typer.Exit as ended:
        code = ended.exit_code
    sys.stdout.flush()
    return code


def _say(error: RrridError, as_json: bool) -> None:
    """Print the error on each stream that takes it; the exit code reports it in any case."""
    try:
        say_error(error)
    except OSError:
        _mute(sys.stderr)
    try:
        if as_json:
            say_error_object(error)
        sys.stdout.flush()
    except OSError:
        _mute(sys.stdout)


def _no_folder(problem: RrridError) -> RrridError:
    """`problem`, or that the working folder is gone, which explains what the machine could not do."""
    try:
        os.getcwd()
    except FileNotFoundError:
        if isinstance(problem, EnvironmentFault):
            return EnvironmentFault("P02", "the folder that the command was called in was deleted", where="working folder",
                                    remedy="call it from a folder that exists (cd)")
    return problem


def _mute(*streams: TextIO) -> None:
    """Discard further output on these streams, or both: the reader of the pipe has left, or the disk is full."""
    for stream in streams or (sys.stdout, sys.stderr):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _call(words: list[str]) -> None:
    """Parse and run, without the parser's own way of ending: it has other words for errors, and 1 for Ctrl-C.

    Raises:
        typer.Exit: done, with the exit code.
        UsageError: C01, an unknown option or command; C02, an argument is missing or has the wrong form.
    """
    only = _with_only(words[0]) if words else app
    command = typer.main.get_command(only)
    try:
        with command.make_context("rrrid", list(words)) as context:
            command.invoke(context)
    except WrongUsage as problem:
        if not words:  # `rrrid` alone: the help
            print(problem.format_message(), file=sys.stderr)
            raise typer.Exit(2) from None
        raise as_error(problem, "rrrid" if only.registered_commands is app.registered_commands else f"rrrid {words[0]}") from None


def _with_only(word: str) -> typer.Typer:
    """The application with the one command that is called for; with all of them where `word` is none, for a hint."""
    named = [command for command in app.registered_commands
             if word == (command.name or getattr(command.callback, "__name__", None))]
    narrow = copy.copy(app)
    narrow.registered_commands = named or app.registered_commands
    return narrow


def _deaf() -> None:
    """All is decided: no signal may end the last words in a traceback."""
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, signal.SIG_IGN)


def _leave(exit_code: int) -> NoReturn:
    """End without taking the interpreter apart: a signal that broke into a C library may have left it where that crashes."""
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError):
            stream.flush()
    os._exit(exit_code)


def _again(lost: Any) -> None:
    """A signal that came while Python could raise nothing (in a destructor, in a callback of C) comes once more."""
    if isinstance(lost.exc_value, Interrupted):
        import threading

        threading.Timer(0.01, os.kill, (os.getpid(), lost.exc_value.exit_code - 128)).start()
    elif "h5py" not in str(lost.object):  # what a full disk makes of HDF5's objects, beside the error that has been told
        sys.__unraisablehook__(lost)


def _internal(problem: Exception) -> RrridError:
    """An error of ours: the traceback goes to a file, the user gets one line."""
    import tempfile
    import traceback

    with tempfile.NamedTemporaryFile("w", prefix="rrrid-crash-", suffix=".txt", delete=False, encoding="utf-8") as file:
        file.write(f"{' '.join(sys.argv)}\n\n")
        traceback.print_exception(problem, file=file)
    return RrridError("Z70", f"internal error: {type(problem).__name__}: {problem}", remedy=f"please report it with {file.name}")


if __name__ == "__main__":
    entry()
