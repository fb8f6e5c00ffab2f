"""The command `replay`: a recorded run in the viewer, as a picture or as a film."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast, get_args

import typer

from feeder_sim.cli.files import AsJson, writable
from feeder_sim.cli.terminal import progress_bar
from feeder_sim.errors import InputError, NotAllowed, quoted

if TYPE_CHECKING:
    from feeder_sim.replay.colours import Colour

Folder = Annotated[Path, typer.Argument(help="Run folder, or a file exported from it.", show_default=False)]


def replay(
    folder: Folder,
    screenshot: Annotated[
        Path | None, typer.Option("--screenshot", help="Write a picture (.png, .jpg); needs no screen.")
    ] = None,
    at: Annotated[float | None, typer.Option("--at", min=0.0, help="Time shown in the screenshot [1 s].")] = None,
    video: Annotated[Path | None, typer.Option("--video", help="Write a film (.mp4); needs no screen.")] = None,
    html: Annotated[Path | None, typer.Option("--html", help="Write a page that plays anywhere, offline.")] = None,
    begin: Annotated[float | None, typer.Option("--from", min=0.0, help="Begin of the film [0 s].")] = None,
    end: Annotated[float | None, typer.Option("--to", min=0.0, help="End of the film [that of the record].")] = None,
    speed: Annotated[
        float | None, typer.Option("--speed", help="Times as fast as it was, 0.1: slow motion [1, or 20 s of film].")
    ] = None,
    fps: Annotated[float | None, typer.Option("--fps", help="Frames of the film per second [25].")] = None,
    size: Annotated[str | None, typer.Option("--size", help="Of the film [1280x720].")] = None,
    slow: Annotated[bool, typer.Option("--slow-motion", help="Times are those of the slow-motion timeline.")] = False,
    show_seed: Annotated[int, typer.Option("--show-seed", min=0, help="Index of the seed shown in 3D.")] = 0,
    colour: Annotated[
        str | None, typer.Option("--colour", help="Of parts: kind or pose [pose where picks ask for a side up].")
    ] = None,
    rebuild: Annotated[
        bool, typer.Option("--rebuild", help="Build the .rrd again, as pictures and films always do.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Open a recorded run in the rerun viewer, take a picture of it, make a film or a page that plays."""
    from feeder_sim.replay.scenery import SLOW, TIMELINE
    from feeder_sim.replay.viewer import FORMATS, SIZE, displayed_time, open_viewer, replay_file, take_screenshot

    outputs = [key for key, path in (("--screenshot", screenshot), ("--video", video), ("--html", html)) if path]
    if len(outputs) > 1:
        raise InputError(f"is not allowed together with {outputs[0]}", key=outputs[1])
    if at is not None and screenshot is None:
        raise InputError("belongs to --screenshot", key="--at")
    of_films = {"--from": begin, "--to": end, "--speed": speed, "--fps": fps, "--size": size}
    film_options = [key for key, value in of_films.items() if value is not None]
    if film_options and video is None:
        raise InputError("belongs to --video", key=film_options[0])
    meaning, timeline = _colour(colour), SLOW if slow else TIMELINE
    if video is not None:
        from feeder_sim.replay.video import check_library, film_of, make_film

        check_library()
        _check_new(video, "--video", (".mp4",))
        film = film_of(folder, begin, end, speed=speed, fps=fps, size=_size(size), seed=show_seed, slow=slow)
        with progress_bar(str(video)) as progress:
            make_film(folder, video, film, seed=show_seed, colour=meaning, progress=progress)
        _tell(as_json, {"video": str(video), "seed": show_seed, **film.as_json_object()})
        return
    if html is not None:
        _check_new(html, "--html", (".html", ".htm"))
        _tell(as_json, {"page": str(html), "seed": show_seed, "bytes": _write_page(folder, html, show_seed, meaning)})
        return
    if screenshot is not None:
        _check_new(screenshot, "--screenshot", tuple(FORMATS))
        moment = displayed_time(folder, at, seed=show_seed, slow=slow)
        take_screenshot(folder, screenshot, at=moment, timeline=timeline, seed=show_seed, colour=meaning)
        facts = {"timeline": timeline, "time_s": moment, "size_pixels": SIZE}
        _tell(as_json, {"screenshot": str(screenshot), "seed": show_seed, **facts})
        return
    if slow:
        raise InputError("belongs to --screenshot and --video; in the viewer choose the timeline", key="--slow-motion")
    file = replay_file(folder, seed=show_seed, colour=meaning, rebuild=rebuild)
    open_viewer(file)
    _tell(as_json, {"replay": str(file), "seed": show_seed})


def _write_page(folder: Path, file: Path, seed: int, meaning: Colour | None) -> int:
    """Write the replay as one page, and say how many bytes it has."""
    from feeder_sim.document.player import Player
    from feeder_sim.records.trajectory_file import read_recording
    from feeder_sim.replay.page import replay_page
    from feeder_sim.whole_files import write_whole

    recording = read_recording(folder)
    player = Player(
        lambda: replay_page(recording, seed, colour=meaning),
        title=f"Replay of {recording.path.parent.name}",
        caption="",
    )
    content = player.alone().encode()
    write_whole(file, content)
    return len(content)


def _tell(as_json: bool, facts: dict[str, Any]) -> None:
    """Print what was made, where JSON is asked for."""
    if as_json:
        print(json.dumps(facts))


def _check_new(path: Path, key: str, suffixes: tuple[str, ...]) -> None:
    """Refuse a path that cannot be written, or to which no such file can be."""
    if path.suffix.lower() not in suffixes:
        raise InputError(f"is {quoted(path.suffix)}, must be {', '.join(suffixes)}", file=path, key=key)
    writable(path)


def _colour(text: str | None) -> Colour | None:
    """What the colours of parts stand for."""
    from feeder_sim.replay.colours import Colour

    for meaning in get_args(Colour):
        if text == meaning:
            return cast("Colour", meaning)
    if text is not None:
        raise NotAllowed(text, f"{' or '.join(get_args(Colour))}", key="--colour")
    return None


def _size(text: str | None) -> tuple[int, int] | None:
    """Width and height [pixels] of a text as 1280x720."""
    if text is None:
        return None
    numbers = text.split("x")
    if len(numbers) != 2 or not all(n.isascii() and n.isdigit() and len(n) <= 5 for n in numbers):
        raise NotAllowed(text, "WIDTHxHEIGHT, such as 1280x720", key="--size")
    return int(numbers[0]), int(numbers[1])
