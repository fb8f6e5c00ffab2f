"""A single seed of a scenario by itself, as it is in the ensemble, in whatever process."""

from __future__ import annotations

import threading
from collections import OrderedDict

from feeder_sim.errors import FeederSimError, InputError
from feeder_sim.pool.work import STALL_AFTER_S
from feeder_sim.records.seed import Seed
from feeder_sim.run.compilation import compile_engine
from feeder_sim.run.prepare import prepare
from feeder_sim.run.provenance import identity_of
from feeder_sim.run.seed_run import SeedRun
from feeder_sim.scenario import Scenario
from feeder_sim.scene.prepared import Prepared
from feeder_sim.single_thread import single_threaded

MOST_PREPARED = 8  # prepared scenarios of a process

_prepared: OrderedDict[str, Prepared | InputError] = OrderedDict()
_compiled: set[str] = set()  # methods of engines, in this process


def run_one_seed(prepared: Prepared, index: int, *, stall_after: float = STALL_AFTER_S) -> Seed:
    """Run one seed on one thread; the bits are those of the same seed of `simulate`."""
    return SeedRun(prepared, index, stall_after=stall_after).run(threading.Event())


@single_threaded
def run_seed_elsewhere(scenario: Scenario, identity: str, index: int, *, stall_after: float) -> Seed:
    """Run one seed in a process that has been sent its scenario; arguments as for `prepared_once`.

    Raises:
        InputError: the scenario cannot be built, or there is no room for its parts.
        FeederSimError: as for `prepared_once`.
    """
    prepared = prepared_once(scenario, identity)
    if isinstance(prepared, InputError):
        raise prepared
    return run_one_seed(prepared, index, stall_after=stall_after)


def prepared_once(scenario: Scenario, identity: str) -> Prepared | InputError:
    """Prepare a scenario, and compile its engine; what this process has prepared last is kept.

    Args:
        scenario: what to prepare.
        identity: that it has where it comes from, see `feeder_sim.run.provenance`.

    Raises:
        FeederSimError: this process has another version of the package, or other files than who asks.
    """
    if identity not in _prepared:
        if identity_of(scenario) != identity:
            raise FeederSimError("a worker has another version of the package, or of a file that the scenario reads")
        try:
            _prepared[identity] = prepared = prepare(scenario)
            if prepared.engine.method not in _compiled:  # else a seed would take longer for its first frame than it may
                compile_engine(prepared)
                _compiled.add(prepared.engine.method)
        except InputError as error:
            _prepared[identity] = error
        while len(_prepared) > MOST_PREPARED:
            _prepared.popitem(last=False)
    _prepared.move_to_end(identity)
    return _prepared[identity]
