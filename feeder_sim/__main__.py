"""The command `feeder-sim`, and `python -m feeder_sim`."""

from __future__ import annotations

import atexit
import os
import sys
from typing import NoReturn

from feeder_sim.cli.main import main


def command() -> NoReturn:
    """Run the command line, and leave without taking the interpreter apart, which takes a third of a second.

    What libraries want done at the end is done.
    """
    try:
        main()
    except SystemExit as end:
        if not isinstance(end.code, int):
            raise
        atexit._run_exitfuncs()
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os._exit(end.code)


if __name__ == "__main__":
    command()
