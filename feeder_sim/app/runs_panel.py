"""The runs of the folder: to start, to watch, to stop, to read and to compare."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from nicegui import run, ui

from feeder_sim.app.fields import notify
from feeder_sim.errors import FeederSimError
from feeder_sim.report.document_of import document_of
from feeder_sim.run.run_folder import fresh_folder
from feeder_sim.studies.compare import Comparison, in_words, measured_run
from feeder_sim.whole_files import write_whole

if TYPE_CHECKING:
    from feeder_sim.app.page import Page

REPORT = "report.html"  # its name in the folder of a run


class RunsPanel:
    """The runs as a page shows them; they belong to the server, and go on without it."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.read = ""  # name of the run that is read
        self.bars: dict[str, tuple[Any, Any]] = {}

    @ui.refreshable_method
    def table(self) -> None:
        """How long, how often; all runs, the last one first; and what came out of one."""
        with ui.row().classes("items-end"):
            self.page.fields.numbers("run", "seeds", "duration_s")
            ui.button("Run", on_click=self.start).props("no-caps")
        self.bars = {}
        for name, page_run in reversed(self.page.runs.by_name.items()):
            with ui.row().classes("w-full items-center"):
                ui.label(name)
                bar = ui.linear_progress(page_run.done, show_value=False).classes("w-32")
                self.bars[name] = bar, ui.label(page_run.words).classes("said")
                if page_run.ended:
                    ui.button("Read", on_click=lambda _, name=name: self.open(name)).props("dense flat no-caps")
                else:
                    ui.button("Stop", on_click=page_run.stop).props("dense flat no-caps")
        self.lines = ui.label().classes("w-full result").style("white-space: pre-wrap; font-family: monospace")
        self.frame = ui.element("iframe").props('sandbox="allow-scripts" title="Report"')
        self.frame.classes("w-full").style("height: 70vh; border: 0")
        self.frame.visible = False

    def start(self) -> None:
        """Run the draft as it is."""
        draft = self.page.draft
        if self.page.problem is not None:
            notify(self.page.problem)
            return
        try:
            folder = fresh_folder(draft.file.stem, draft.file.parent / "runs")
        except FeederSimError as error:
            notify(error)
            return
        self.page.runs.start(draft.text, draft.file, folder)
        self.table.refresh()

    def update(self) -> None:
        """Bring the bars up to date, and the table when a run begins or ends."""
        page_runs = self.page.runs.by_name
        ended = [name for name, page_run in page_runs.items() if not page_run.ended and page_run.poll().ended]
        if ended or set(self.bars) != set(page_runs):
            self.table.refresh()
        for name, (bar, label) in self.bars.items():
            page_run = page_runs[name]
            bar.value, label.text = page_run.done, page_run.words

    async def open(self, name: str) -> None:
        """Show what came out of a run: its lines, how it differs from the one before it, its report with the replay."""
        page_run = self.page.runs.by_name[name]
        completed = [other for other, other_run in self.page.runs.by_name.items() if other_run.ended == "done"]
        earlier = completed[completed.index(name) - 1] if name in completed and completed.index(name) else None
        self.lines.text = "\n".join(page_run.lines)
        try:
            if earlier is not None:
                self.lines.text += (
                    f"\n\n{await run.io_bound(_compared, self.page.runs.by_name[earlier].folder, page_run.folder)}"
                )
            await run.io_bound(_report, page_run.folder)
        except FeederSimError as error:
            self.lines.text += f"\n{error}"
            return
        self.frame.props(f'src="/report/{name}"')
        self.frame.visible = True


def _compared(first: Path, second: Path) -> str:
    return in_words(Comparison(measured_run(first), measured_run(second)))


def _report(folder: Path) -> None:
    """Write the report of a run, if there is none."""
    if not (folder / REPORT).is_file():
        write_whole(folder / REPORT, document_of(folder, replay=True).html().encode())
