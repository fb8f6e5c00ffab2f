"""The server of the page: on this machine alone, with a token, and nothing from elsewhere."""

from __future__ import annotations

import asyncio
import json
import secrets
import socket
from pathlib import Path

from nicegui import app, background_tasks, ui
from starlette.responses import FileResponse, PlainTextResponse, Response

from feeder_sim.app.draft import Draft
from feeder_sim.app.guarded import Guarded
from feeder_sim.app.page import Page
from feeder_sim.app.runs import Runs
from feeder_sim.app.runs_panel import REPORT

HOST = "127.0.0.1"


def serve(text: str, file: Path, *, port: int | None, show: bool, as_json: bool = False) -> None:
    """Serve the page of a scenario until the command is interrupted.

    Args:
        text: of the scenario.
        file: that it is, or would be; what is put in and runs stand beside it.
        port: of the server; None for one that is free.
        show: open it in the browser.
        as_json: print the address as a JSON object.
    """
    port = port or _free_port()
    token = secrets.token_urlsafe(18)
    runs = Runs()

    async def page() -> None:
        await ui.context.client.connected()
        storage = app.storage.tab
        draft = storage.setdefault("draft", Draft(text, file))  # what a tab has written survives its reload
        Page(draft, runs).build()

    def report(name: str) -> Response:
        run = runs.by_name.get(name)
        path = run.folder / REPORT if run else None
        if path is None or not path.is_file():
            return PlainTextResponse("feeder-sim: no such report\n", status_code=404)
        return FileResponse(path, media_type="text/html")

    app.get("/report/{name}")(report)
    app.add_middleware(Guarded, token=token, port=port)
    app.on_shutdown(runs.stop_all)
    address = f"http://{HOST}:{port}/?token={token}"

    async def print_address() -> None:
        while not _listens(port):
            await asyncio.sleep(0.05)
        print(json.dumps({"address": address}) if as_json else f"{address}\nCtrl+C ends the server", flush=True)

    app.on_startup(lambda: background_tasks.create(print_address()))
    ui.run(
        page,
        host=HOST,
        port=port,
        title="feeder_sim",
        show=address.partition(f":{port}")[2] if show else False,
        reload=False,
        show_welcome_message=False,
        uvicorn_logging_level="error",
        message_history_length=100,  # each holds up to a hundred kilobytes
    )


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex((HOST, port)) == 0


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])
