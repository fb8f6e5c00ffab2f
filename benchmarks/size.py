"""Code lines and files of the package, its tests, benchmarks and examples, room by room.

    python benchmarks/size.py [--rooms] [--most]

Blank lines, comments and docstrings do not count. With --most every room of the package is held against its budget,
benchmarks/size.toml, and against the commit before; it ends with 1 if a room has grown out of it.
"""

from __future__ import annotations

import ast
import io
import subprocess
import tarfile
import tokenize
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated

import typer

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("feeder_sim", "tests", "benchmarks", "conformance", "docs/examples", "models")
SKIPPED = (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER)
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def code_lines(text: str) -> int:
    """Number of lines of a source that hold code."""
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    lines = {line for token in tokens if token.type not in SKIPPED for line in range(token.start[0], token.end[0] + 1)}
    return len(lines - set(docstring_lines(text)))


def docstring_lines(text: str) -> Iterator[int]:
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            text_of = node.body[0]
            yield from range(text_of.lineno, (text_of.end_lineno or text_of.lineno) + 1)


Rooms = Counter[str]


def rooms_of(sources: Iterable[tuple[str, str]]) -> tuple[Rooms, Rooms]:
    """Code lines and files of every room, of the path in a folder and the text of each source."""
    lines, files = Counter[str](), Counter[str]()
    for path, text in sources:
        room = path.split("/")[0]
        lines[room] += code_lines(text)
        files[room] += 1
    return lines, files


def present(folder: str) -> Iterator[tuple[str, str]]:
    for file in sorted((ROOT / folder).rglob("*.py")):
        yield file.relative_to(ROOT / folder).as_posix(), file.read_text()


def committed(folder: str, commit: str) -> Iterator[tuple[str, str]]:
    """As `present`, of a commit."""
    git = subprocess.run(["git", "archive", commit, folder], cwd=ROOT, capture_output=True, check=False)
    if git.returncode:  # a clone without its history
        return
    archive = git.stdout
    with tarfile.open(fileobj=io.BytesIO(archive)) as files:
        for member in files:
            content = files.extractfile(member)
            if content is not None and member.name.endswith(".py"):
                yield member.name.removeprefix(f"{folder}/"), content.read().decode()


def hold_against_budget() -> bool:
    """Print lines, budget and change of every room of the package; returns whether all are within."""
    budget = tomllib.loads((ROOT / "benchmarks/size.toml").read_text())["rooms"]
    lines, _ = rooms_of(present("feeder_sim"))
    before, _ = rooms_of(committed("feeder_sim", "HEAD"))
    if before == lines:
        before, _ = rooms_of(committed("feeder_sim", "HEAD~1"))
    print(f"{'room':<24}  lines  budget  change")
    for room in sorted(lines.keys() | budget.keys(), key=lambda room: (-lines[room], room)):
        above = "  too many" if lines[room] > budget.get(room, 0) else ""
        print(f"{room:<24} {lines[room]:6d}  {budget.get(room, 0):6d}  {lines[room] - before[room]:+6d}{above}")
    print(f"{'all':<24} {lines.total():6d}  {sum(budget.values()):6d}  {lines.total() - before.total():+6d}")
    return all(lines[room] <= budget.get(room, 0) for room in lines)


def main(
    rooms: Annotated[bool, typer.Option(help="also of every folder in the package")] = False,
    most: Annotated[bool, typer.Option(help="hold the rooms of the package against their budgets")] = False,
) -> None:
    if most:
        raise typer.Exit(code=0 if hold_against_budget() else 1)
    for folder in FOLDERS:
        lines, files = rooms_of(present(folder))
        print(f"{folder:<24} {lines.total():6d} lines in {files.total():3d} files")
        for room, count in lines.most_common() if rooms and folder == "feeder_sim" else ():
            print(f"  {room:<22} {count:6d} lines in {files[room]:3d} files")


if __name__ == "__main__":
    typer.run(main)
