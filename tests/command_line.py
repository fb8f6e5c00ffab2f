"""The command line as tests call it: mostly in their own process, which spares seconds of imports each time."""

from __future__ import annotations

import contextlib
import itertools
import os
import resource
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO
from unittest import mock

from feeder_sim.cli.main import main
from feeder_sim.run.compilation import COMPILING
from feeder_sim.run.simulation import LOOKING

Done = subprocess.CompletedProcess[str]


def feeder_sim(*arguments: object, cwd: Path | None = None) -> Done:
    """Run a command in this process; what C libraries write to the terminal counts, too."""
    command = ["feeder-sim", *map(str, arguments)]
    with contextlib.ExitStack() as held:
        out, err = (held.enter_context(tempfile.TemporaryFile("w+", encoding="utf-8")) for _ in range(2))
        for number, file in ((1, out), (2, err)):
            held.enter_context(_leading_to(number, file))
        held.enter_context(contextlib.redirect_stdout(out))
        held.enter_context(contextlib.redirect_stderr(err))
        held.enter_context(mock.patch.object(sys, "argv", command))
        held.enter_context(contextlib.chdir(cwd or Path.cwd()))
        code = _exit_code()
        return subprocess.CompletedProcess(command, code, _written(out), _written(err))


def in_new_process(*arguments: object, cwd: Path | None = None, largest_file: int | None = None) -> Done:
    """Run a command as a user does; perhaps on a disk that is full for what is beyond a size in a file [bytes]."""
    return limited([sys.executable, "-m", "feeder_sim", *map(str, arguments)], cwd, largest_file)


def limited(command: list[str], cwd: Path | None = None, largest_file: int | None = None) -> Done:
    """Run a command line, in which no file may become larger."""

    def small_files() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file or 0, largest_file or 0))

    before = small_files if largest_file else None
    return subprocess.run(command, preexec_fn=before, capture_output=True, text=True, cwd=cwd, timeout=300, check=False)


def said(done: Done) -> list[str]:
    """Lines on stderr, but for notes on what takes long, which depend on what was run before and on the machine."""
    return [line for line in done.stderr.splitlines() if not any(note in line for note in (COMPILING, LOOKING))]


def check_refused(done: Done, *expected: str) -> None:
    """Refused as bad input, in one line that contains all that is expected; " ... " stands between two such texts."""
    assert done.returncode == 2, done.stderr
    message = one_line(done)
    for text in itertools.chain(*(text.split(" ... ") for text in expected)):
        assert text in message, f"{text!r} not in: {message}"


def one_line(done: Done) -> str:
    """The message of a refused command: exactly one line, no traceback."""
    assert done.stdout == ""
    assert len(said(done)) == 1 and "Traceback" not in done.stderr, done.stderr
    return f"{said(done)[0]}\n"


def _exit_code() -> int:
    try:
        main()
    except SystemExit as ending:
        return int(ending.code or 0)


@contextlib.contextmanager
def _leading_to(number: int, file: IO[str]) -> Iterator[None]:
    """Let a file descriptor of the process write to a file."""
    kept = os.dup(number)
    os.dup2(file.fileno(), number)
    try:
        yield
    finally:
        os.dup2(kept, number)
        os.close(kept)


def _written(file: IO[str]) -> str:
    file.flush()
    file.seek(0)
    return file.read()
