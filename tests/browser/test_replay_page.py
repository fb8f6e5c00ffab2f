"""Replays that travel: pages that play in a browser, offline, and run nothing but their player."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from browsing import browser_page, browsing, elsewhere, pixels, wait_for_change, wait_until
from command_line import feeder_sim
from conftest import REPOSITORY, strip_scenario

from feeder_sim.document.player import Player
from feeder_sim.run.run_folder import record_run

pytestmark = [pytest.mark.slow, browsing]
MAILED = 3_000_000  # bytes


def wait_for_colours(page: object) -> None:
    """Wait until pixels are red, and others blue: antinodes in opposite phase.

    The player fades in at each loop; a processor that draws by itself shows little but the first, dark pictures.
    """

    def coloured() -> bool:
        red, _, blue = np.moveaxis(pixels(page, "body"), -1, 0)
        return min(((red > 1.3 * blue) & (red > 20)).mean(), ((blue > 1.2 * red) & (blue > 20)).mean()) > 0.01

    wait_until(coloured)


def test_a_replay_plays_from_a_file(tmp_path: Path) -> None:
    record_run(strip_scenario(duration_s=2.0), tmp_path / "run", replay=False)
    assert feeder_sim("replay", tmp_path / "run", "--html", tmp_path / "page.html").returncode == 0
    with browser_page() as (page, asked):
        page.goto((tmp_path / "page.html").as_uri())
        page.wait_for_selector("canvas")
        assert page.title() == "Replay of run"
        wait_for_change(page, "body")
        wait_for_colours(page)
    assert elsewhere(asked, "file://") == []


def test_the_report_of_a_hundred_nuts_can_be_mailed_and_plays(tmp_path: Path) -> None:
    run = [*("run", REPOSITORY / "scenarios/separation_100.toml", "--seeds", "1"), *("--out", tmp_path / "run")]
    assert feeder_sim(*run).returncode == 0
    assert feeder_sim("report", tmp_path / "run").returncode == 0
    report = tmp_path / "run/report.html"
    assert report.stat().st_size < MAILED
    with browser_page() as (page, asked):
        page.goto(report.as_uri())
        page.locator("iframe").scroll_into_view_if_needed()
        page.frame_locator("iframe").locator("canvas").last.wait_for()
        wait_for_change(page, "iframe")
    assert elsewhere(asked, "file://") == []


def test_no_other_script_runs_beside_a_player(tmp_path: Path) -> None:
    """Not one that came into the page, nor one that came into the page within it."""
    made = "<!doctype html><head><meta charset=\"utf-8\" /><title>a</title></head><script>document.title='own'</script>"
    page_file = tmp_path / "page.html"
    page_file.write_text(Player(lambda: made, title="<b>", caption="").alone())
    with browser_page() as (page, _):
        page.goto(page_file.as_uri())
        assert page.title() == "own"
        page_file.write_text(page_file.read_text() + "<script>document.title='foreign'</script><p>end</p>")
        page.goto(page_file.as_uri())
        page.wait_for_selector("p")
        assert page.title() == "own"
