"""The files of a run in its folder: told from those of others, and written by one process at a time."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from feeder_sim.errors import InputError, not_written

RUN = "run.json"  # written first: a folder is that of a run if it has one
INPUTS = "inputs"  # folder in a run folder
LOCK = ".lock"
NO_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP)  # what network file systems say
SCENE, SEEDS = "scene.h5", "seeds"  # what is recorded of a run: its scene, and a folder with a file for each seed
OWN = (SCENE, "replay*.rrd", "summary.json", "picks.csv", "scenario.toml", "scene.xml")


def check_no_links(folder: Path) -> None:
    """Refuse a run folder that holds links in place of files of the run: they would be read and written elsewhere.

    Raises:
        InputError: a link by the name of a file of the run, or anywhere among its inputs and seeds.
    """
    folders = (INPUTS, f"{INPUTS}/*", SEEDS, f"{SEEDS}/*")
    for name in (RUN, LOCK, *folders, *OWN, *(f"{pattern}.*" for pattern in OWN)):
        for path in sorted(folder.glob(name)):
            if path.is_symlink():
                raise InputError("is a link, must be a file of the run itself", file=path)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other processes from writing into a run folder; the operating system lets go when this one ends, or dies.

    Raises:
        InputError: another process writes into it, or nobody can.
    """
    check_no_links(folder)
    with holding(folder / LOCK):
        yield


@contextmanager
def holding(path: Path, wait_s: float = 0.0) -> Iterator[None]:
    """Hold the lock on a file, which stands for its folder or a part of the work in it.

    Args:
        path: of the file, which is made if missing.
        wait_s: how long to wait for another process [s].

    Raises:
        InputError: another process holds it, or nobody can.
    """
    from filelock import FileLock, Timeout

    if path.is_symlink():
        raise InputError("is a link, must be a file of the folder itself", file=path)
    # A lock that lies in the file would outlive its process.
    lock = FileLock(path, timeout=wait_s, fallback_to_soft=False)
    try:
        lock.acquire()
    except Timeout:
        problem = "is in use, must be one process that writes into it at a time"
        raise InputError(problem, file=path.parent) from None
    except NotImplementedError:
        pass  # on a file system without locks it is better to work without one than not at all
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise not_written(path, error) from error
    try:
        yield
    finally:
        lock.release()
