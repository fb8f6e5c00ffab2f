"""The files of a run in its folder: told from those of others, and written by one process at a time."""

from __future__ import annotations

import errno
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from feeder_sim.errors import InputError, not_written

CHECKPOINTS, INPUTS = "checkpoints", "inputs"  # folders in a run folder
LOCK = ".lock"
NO_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP)  # what network file systems say
_OWN = re.compile(
    rf"(trajectory\.h5|replay(_seed_\d+)?\.rrd|summary\.json|picks\.csv|scenario\.toml|scene\.xml|seed_\d+\.npz|failure_seed_\d+(_\d+)?\.npz"
    rf"|{CHECKPOINTS}|{INPUTS})(\.new|\.partial)?|{re.escape(LOCK)}"
)


def is_own(name: str) -> bool:
    """Whether a run gives this name to a file, or to a folder, in its folder."""
    return _OWN.fullmatch(name) is not None


def check_no_links(folder: Path) -> None:
    """Refuse a run folder that holds links in place of files of the run: they would be read and written elsewhere.

    Raises:
        InputError: a link by the name of a file of the run, or anywhere among its inputs.
    """
    for inside in (folder, folder / CHECKPOINTS, folder / INPUTS):
        for path in sorted(inside.iterdir()) if inside.is_dir() else ():
            if path.is_symlink() and (is_own(path.name) or inside.name == INPUTS):
                raise InputError("is a link, allowed is a file of the run itself", file=path)


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
        raise InputError("is a link, allowed is a file of the folder itself", file=path)
    # A lock that lies in the file would outlive its process.
    lock = FileLock(path, timeout=wait_s, fallback_to_soft=False)
    try:
        lock.acquire()
    except Timeout:
        problem = "is in use, allowed is one process that writes into it at a time"
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
