"""Workers that cannot be had: one line says why."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from feeder_sim import InputError
from feeder_sim.pool.work import Work
from feeder_sim.pool.workers import local_workers, on_cluster

UNGUARDED = """
import feeder_sim
scenario = feeder_sim.load_scenario("ball_50hz").changed({"run.duration_s": 0.1})
feeder_sim.sweep(scenario, {"drive[0].amplitude_um": [200.0]}, seeds=1, workers=1)
"""


@pytest.mark.slow  # starts four processes
def test_a_script_without_a_guard_is_told_to_have_one(tmp_path: Path) -> None:
    """And once: processes that import it end without a word."""
    script = tmp_path / "unguarded.py"
    script.write_text(UNGUARDED)
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 1 and done.stderr.count("Traceback") == 1, done.stderr
    assert 'put the call below `if __name__ == "__main__":`' in done.stderr.splitlines()[-1]


def test_a_script_from_standard_input_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules["__main__"], "__file__", "<stdin>", raising=False)
    with pytest.raises(InputError, match="standard input, must be one in a file"), local_workers(1):
        pass


@pytest.mark.parametrize(
    "address", ["nonsense", "tcp://host", "nosuch://host:8786", "host:port", "host:99999", "inproc://1"]
)
def test_an_address_of_no_scheduler_is_refused_before_a_client_is_made(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A client that fails halfway says so once more when it is cleaned up, in a traceback."""
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(distributed, "Client", lambda *_, **__: pytest.fail("a client was made"))
    with pytest.raises(InputError, match=f"--dask: is '{address}', must be an address"), on_cluster(Work(), address):
        pass
