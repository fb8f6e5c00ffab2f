"""Who runs tasks: processes of this machine, or any `concurrent.futures.Executor`, as that of a Dask cluster."""

from __future__ import annotations

import multiprocessing
import os
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, ProcessPoolExecutor
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, replace
from typing import Any

from feeder_sim.errors import InputError, MissingExtra, quoted
from feeder_sim.pool.work import Work, available_cores

CLUSTER_WAIT_S = 30.0  # [s] until a scheduler has to have answered
LAST_PORT = 65535
GUARD = 'each imports the script that calls, so put the call below `if __name__ == "__main__":`'


@dataclass
class Workers:
    """An executor with its number of workers.

    Attributes:
        executor: takes the tasks.
        count: how many tasks run at once.
        restart: another executor in place of one that is broken; None where there is no other.
        lost: errors by which it says that a task is lost for good.
        interrupt: ends the tasks under way, which come back as far as they are; None where nothing can.
    """

    executor: Executor
    count: int
    restart: Callable[[], Executor] | None = None
    lost: tuple[type[BaseException], ...] = (CancelledError,)
    interrupt: Callable[[], None] | None = None


@contextmanager
def local_workers(count: int | None = None) -> Iterator[Workers]:
    """Processes of this machine, by default one for each core; they end with this process, however it ends.

    Raises:
        InputError: the script that calls cannot be imported by processes, or calls again as they import it.
    """
    _check_main()
    count = count or available_cores()
    context = multiprocessing.get_context("spawn")
    pools: list[tuple[ProcessPoolExecutor, Any]] = []  # with our end of a pipe, whose class goes by the platform

    def start() -> Executor:
        end, alive = context.Pipe()
        pool = ProcessPoolExecutor(count, mp_context=context, initializer=_live_with, initargs=(end,))
        pools.append((pool, alive))
        return pool

    def restart() -> Executor:
        if not any(alive.poll() for _, alive in pools):
            raise InputError(f"processes end before they begin: {GUARD}; or is memory short?", argument="workers")
        return start()

    try:
        yield Workers(start(), count, restart)
    finally:
        for pool, alive in pools:
            alive.close()  # ends the processes, in whatever they are
            pool.shutdown(cancel_futures=True)


def _check_main() -> None:
    """Refuse a script that processes cannot import; in a process that imports one, end the process without a word.

    There the script calls for processes again. The process that has started this one says so, once.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise SystemExit(1)  # an error would be a traceback of every process
    if getattr(sys.modules["__main__"], "__file__", None) == "<stdin>":
        problem = "processes cannot import a script that Python reads from standard input, must be one in a file"
        raise InputError(problem, argument="workers")


def _live_with(end: Any) -> None:
    """Tell that this process has begun; end it as soon as the one that has started it ends or closes its end."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; who has started it decides
    end.send_bytes(b"begun")

    def watch() -> None:
        end.poll(None)  # until the other end is closed
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def workers_of(work: Work) -> AbstractContextManager[Workers]:
    """The executor of a user, who also ends it, or else processes of this machine; errors as for `local_workers`."""
    if work.executor is None:
        return local_workers(work.workers)
    return nullcontext(Workers(work.executor, work.n_workers, lost=work.lost))


@contextmanager
def on_cluster(work: Work, address: str | None) -> Iterator[Work]:
    """Work that is done on a Dask cluster, by the address of its scheduler; without an address, where it was done.

    Args:
        work: how it is shown and ended.
        address: such as tcp://host:8786.

    Raises:
        InputError: Dask is not installed, the address is none, or no scheduler answers.
    """
    if address is None:
        yield work
        return
    try:
        from distributed import Client
        from distributed.comm.core import CommClosedError
        from distributed.scheduler import KilledWorker
    except ImportError:
        raise MissingExtra("dask", key="--dask") from None
    _check_address(address)
    try:
        client = Client(address, timeout=CLUSTER_WAIT_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(f"is {address!r}, where no scheduler answers: {error}", key="--dask") from error
    with client:
        threads = max(1, sum(client.nthreads().values()))
        executor, lost = client.get_executor(pure=False, retries=2), (CancelledError, KilledWorker, CommClosedError)
        yield replace(work, workers=threads, executor=executor, lost=lost)


def _check_address(address: str) -> None:
    """Refuse what is no address. Dask's client would do so half made, and end in a traceback a minute later.

    Raises:
        InputError: as said.
    """
    from distributed.comm.addressing import get_address_host_port

    try:
        _, port = get_address_host_port(address)
        if not 1 <= port <= LAST_PORT:
            raise ValueError(f"the port is {port}")
    except ValueError as error:
        problem = f"is {quoted(address)}, must be an address such as tcp://host:8786 ({error})"
        raise InputError(problem, key="--dask") from error
