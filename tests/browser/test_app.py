"""The page on which feeders are designed, from a new user's first click to the same bits on the command line."""

from __future__ import annotations

import contextlib
import http.client
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import h5py
import numpy as np
import pytest
import trimesh
from browsing import PIXEL, browser_page, browsing, elsewhere, wait_for_change
from command_line import feeder_sim
from conftest import REPOSITORY

pytestmark = [pytest.mark.slow, browsing]
L_SHAPE = ((-90, -60), (90, -60), (90, 0), (0, 0), (0, 60), (-90, 60))


@contextlib.contextmanager
def serving(folder: Path, *words: str) -> Iterator[tuple[str, Path]]:
    """The address of a server with its token, and the folder that it works in."""
    command = [sys.executable, "-m", "feeder_sim", "app", *words, "--no-show", "--folder", str(folder / "mine")]
    alone = {name: value for name, value in os.environ.items() if name != "PYTEST_CURRENT_TEST"}  # NiceGUI looks for it
    process = subprocess.Popen(
        command, cwd=folder, env=alone, stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stdout is not None
    address = process.stdout.readline().strip()
    assert address.startswith("http://127.0.0.1:") and "?token=" in address
    yield address, folder / "mine"
    os.killpg(process.pid, signal.SIGINT)
    process.communicate()
    assert process.returncode in (0, 130, -signal.SIGINT)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, Path]]:
    """A server that begins with a nut on a plate with one patch."""
    with serving(tmp_path_factory.mktemp("app")) as served:
        yield served


def opened(page: Any, address: str) -> None:
    page.goto(address)
    page.wait_for_function("window.feederPlate && window.feederPlate.field")


def click(page: Any, x: float, y: float) -> None:
    page.mouse.click(*page.evaluate(PIXEL, [x, y]))


def drag(page: Any, begin: tuple[float, float], end: tuple[float, float]) -> None:
    page.mouse.move(*page.evaluate(PIXEL, list(begin)))
    page.mouse.down()
    for share in np.linspace(0.0, 1.0, 9):
        at = [(1 - share) * a + share * b for a, b in zip(begin, end, strict=True)]
        page.mouse.move(*page.evaluate(PIXEL, at))
        time.sleep(0.05)  # as a hand moves it, so that the motion follows
    page.mouse.up()


def tab(page: Any, name: str) -> None:
    page.get_by_role("tab", name=name).click()


def text_of(page: Any, folder: Path) -> str:
    """The draft as it is downloaded."""
    with page.expect_download() as found:
        page.get_by_label("Download the TOML").click()
    found.value.save_as(folder / "downloaded.toml")
    return (folder / "downloaded.toml").read_text(encoding="utf-8")


def test_from_a_drawn_plate_to_a_replay_and_the_same_bits(server: tuple[str, Path]) -> None:
    address, folder = server
    trimesh.creation.box((4.0, 3.0, 2.0)).export(folder.parent / "my part.stl")
    with browser_page(width=1500, height=900) as (page, asked):
        opened(page, address)
        page.get_by_role("button", name="draw outline").click()
        page.wait_for_function("window.feederPlate.tool === 'outline'")
        for corner in (*L_SHAPE, L_SHAPE[0]):
            click(page, *corner)
        page.wait_for_selector("text=reaches beyond it")  # the patch lies in what was cut off
        drag(page, (30, 20), (-40, 20))
        page.wait_for_function("document.querySelector('.error').innerText === ''")
        page.get_by_role("button", name="put patch").click()
        page.wait_for_function("window.feederPlate.tool === 'actuator'")
        click(page, 50, -30)
        page.wait_for_function("window.feederPlate.scene.things.filter((t) => t.kind === 'actuator').length === 2")
        page.wait_for_function("document.querySelector('.words').innerText.includes('Hz')")

        tab(page, "Modes")
        page.locator("tr", has_text="gathers").first.wait_for()
        before = page.locator(".words").inner_text()
        page.locator("tbody tr").nth(6).click()
        page.wait_for_function("(old) => document.querySelector('.words').innerText !== old", arg=before)
        page.get_by_role("button", name="drift").click()
        wait_for_change(page, "canvas >> nth=0", 1e-4)  # walkers walk

        tab(page, "Part")
        page.locator(".q-uploader input[type=file]").last.set_input_files(folder.parent / "my part.stl")
        page.locator(".poses img").wait_for()

        tab(page, "Schedule")
        page.get_by_role("button", name="Gather, then throw apart").click()
        page.locator("[data-stretch='1']").wait_for()
        box = page.locator("[data-stretch='1']").bounding_box()
        page.mouse.move(box["x"] + 4, box["y"] + 20)
        page.mouse.down()
        page.mouse.move(box["x"] + 24, box["y"] + 20, steps=4)
        page.mouse.up()

        tab(page, "Run")
        seeds = page.locator("[data-key='run.seeds'] input, input[data-key='run.seeds']").first
        seeds.fill("1")
        seeds.press("Enter")
        page.get_by_role("button", name="Run", exact=True).click()
        page.get_by_role("button", name="Read").first.wait_for()
        assert page.locator(".said").first.inner_text().startswith("done")
        text = text_of(page, folder)
        page.get_by_role("button", name="Read").first.click()
        frame = page.frame_locator("iframe[title=Report]").frame_locator("iframe[title=Replay]")
        frame.locator("canvas").last.wait_for()
        assert "picked" in page.locator(".result").inner_text()
    assert elsewhere(asked, address.split("?")[0].rstrip("/")) == [
        url for url in asked if url.startswith("ws://127.0.0.1:")
    ]
    assert 'file = "my_part.stl"' in text and text.count("[[schedule.stage]]") == 2 and "seeds = 1" in text
    (folder / "again.toml").write_text(text)
    done = feeder_sim("run", folder / "again.toml", "--out", folder / "again")
    assert done.returncode == 0, done.stderr
    (run,) = (folder / "runs").iterdir()
    with h5py.File(run / "seeds/000.h5") as one, h5py.File(folder / "again/seeds/000.h5") as other:
        names: list[str] = []
        one.visititems(lambda name, held: names.append(name) if isinstance(held, h5py.Dataset) else None)
        numbers = [name for name in names if one[name].dtype.kind in "fi"]
        assert {"position", "removals/time"} <= set(numbers)
        for name in numbers:
            np.testing.assert_array_equal(one[name][()], other[name][()], err_msg=name)


def test_tabs_do_not_disturb_each_other_and_a_reload_loses_nothing(server: tuple[str, Path]) -> None:
    address, folder = server
    with browser_page(width=1500, height=900) as (page, _):
        opened(page, address)
        other = page.context.new_page()
        opened(other, address)
        drag(page, (30, 20), (-40, 20))
        page.wait_for_function("window.feederPlate.scene.things[0].x === -40")
        assert "[30.0, 20.0]" in text_of(other, folder) and "[-40.0, 20.0]" in text_of(page, folder)
        page.get_by_label("Save the file").click()
        page.wait_for_selector("text=saved as")
        assert "[-40.0, 20.0]" in (folder / "scenario.toml").read_text()
        page.reload()
        page.wait_for_function("window.feederPlate && window.feederPlate.field")
        assert "[-40.0, 20.0]" in text_of(page, folder)
        page.get_by_label("Undo").click()
        page.wait_for_function("window.feederPlate.scene.things[0].x === 30")
        assert "# A nut on a plate" in text_of(page, folder)  # comments stay
        page.get_by_label("Save the file").click()
        page.wait_for_function("document.body.innerText.includes('saved as')")
        assert "[30.0, 20.0]" in (folder / "scenario.toml").read_text()
        other.get_by_label("Save the file").click()  # its text is what the file holds by now
        other.wait_for_selector("text=saved as")
        (folder / "scenario.toml").write_bytes(b"\xff\xfe")
        other.get_by_label("Save the file").click()
        other.wait_for_selector("text=scenario.toml: cannot be read as text")


def test_what_cannot_be_stands_beside_the_field(server: tuple[str, Path]) -> None:
    address, folder = server
    with browser_page(width=1500, height=900) as (page, _):
        opened(page, address)
        field = page.locator("[data-key='plate.thickness_mm'] input, input[data-key='plate.thickness_mm']").first
        field.fill("-2")
        field.press("Enter")
        page.locator(".q-field", has_text="must be").first.wait_for()
        page.locator(".error", has_text="plate.thickness_mm").wait_for()
        page.locator(".q-uploader input[type=file]").first.set_input_files(
            {"name": "../../evil.txt", "mimeType": "text/plain", "buffer": b"x"}
        )
        page.wait_for_selector("text=must be a file that ends in")
    assert not (folder / "../../evil.txt").exists() and not (folder / "evil.txt").exists()


def test_a_drawing_is_dropped_and_markup_stays_text(server: tuple[str, Path]) -> None:
    address, folder = server
    with browser_page(width=1500, height=900) as (page, _):
        opened(page, address)
        drawn = (REPOSITORY / "docs/tutorial/l_plate.svg").read_text(encoding="utf-8")
        more = '<rect id="fixtures" x="20" y="20" width="4" height="30"/><circle id="outlets" cx="60" cy="20" r="5"/>'
        (folder / "with_fence.svg").write_text(drawn.replace("</svg>", f"{more}</svg>"), encoding="utf-8")
        page.locator(".q-uploader input[type=file]").first.set_input_files(folder / "with_fence.svg")
        page.wait_for_function("window.feederPlate.scene.things.filter((t) => t.kind === 'support').length === 3")
        page.wait_for_function("window.feederPlate.scene.holes.length === 2 && window.feederPlate.scene.width === 160")
        page.wait_for_function(
            "window.feederPlate.scene.fixtures.length * window.feederPlate.scene.outlets.length === 1"
        )
        tab(page, "TOML")
        page.locator(".cm-content").focus()
        page.keyboard.press("Control+a")
        title = 'title = "<img src=x onerror=document.title=1>"'
        page.keyboard.insert_text(title + text_of(page, folder).partition("[plate]")[2].join(["\n[plate]", ""]))
        page.get_by_role("button", name="Take it over").click()
        page.wait_for_selector("text=<img src=x onerror=document.title=1>")
        assert page.title() == "feeder_sim"


@pytest.mark.parametrize(
    ("old", "new"),
    [("[[part]]", "[part]"), ("[[plate.actuator]]", "[plate.actuator]"), (None, "no TOML at all"), (None, "plate = 3")],
)
def test_a_wrong_text_leaves_a_page_with_undo(server: tuple[str, Path], old: str | None, new: str) -> None:
    address, folder = server
    with browser_page(width=1500, height=900) as (page, _):
        opened(page, address)
        right = text_of(page, folder)
        wrong = right.replace(old, new) if old else new
        tab(page, "TOML")
        page.locator(".cm-content").focus()
        page.keyboard.press("Control+a")
        page.keyboard.insert_text(wrong)
        page.get_by_role("button", name="Take it over").click()
        page.locator(".error", has_text="scenario.toml: ").wait_for()
        page.reload()
        page.locator(".error", has_text="scenario.toml: ").wait_for()
        assert text_of(page, folder) == wrong
        page.get_by_label("Undo").click()
        page.wait_for_function("window.feederPlate && window.feederPlate.field")
        assert page.locator(".error").inner_text() == "" and text_of(page, folder) == right


def test_a_plate_with_measured_modes_moves_as_it_will_in_the_run(tmp_path: Path) -> None:
    with serving(tmp_path, "separation_100") as (address, _), browser_page(width=1500, height=900) as (page, _):
        opened(page, address)
        assert page.locator(".words").inner_text().startswith("2646 Hz: up to 36.4 µm")
        assert page.evaluate("window.feederPlate.scene.width") == pytest.approx(180.0)


def test_only_the_browser_with_the_token_is_let_in(server: tuple[str, Path]) -> None:
    address, folder = server
    parts = urlsplit(address)

    def asked(path: str, method: str = "GET", **headers: str) -> tuple[int, str]:
        connection = http.client.HTTPConnection("127.0.0.1", parts.port)
        connection.request(method, path, headers=headers)
        answer = connection.getresponse()
        said = answer.read().decode()
        connection.close()
        return answer.status, said

    token = parts.query.removeprefix("token=")
    assert asked(f"/?{parts.query}")[0] == 303
    cookie = f"feeder_sim_{parts.port}={token}"
    assert asked("/", Cookie=cookie)[0] == 200
    for path, headers, status in (
        ("/", {}, 403),
        ("/?token=wrong", {}, 403),
        (f"/?{parts.query}", {"Host": "evil.example"}, 421),
        ("/", {"Cookie": cookie, "Origin": "http://evil.example"}, 403),
        ("/_nicegui_ws/socket.io/?EIO=4&transport=polling", {}, 403),
    ):
        found, said = asked(path, **headers)
        assert found == status and said.startswith("feeder-sim: ") and said.count("\n") == 1
    assert asked("/report/none", Cookie=cookie)[0] == 404
    for path in ("/report/..%2f..%2fscenario.toml", "/report/../../scenario.toml", "/_nicegui/../../../etc/passwd"):
        assert "[plate]" not in asked(path, Cookie=cookie)[1] and "root:" not in asked(path, Cookie=cookie)[1]
    assert asked("/", "POST", **{"Cookie": cookie, "Content-Length": "500000000"})[0] == 413
    assert sorted(path.name for path in folder.parent.iterdir() if path.suffix != ".stl") == ["mine"]
