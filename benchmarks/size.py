"""Code lines and files of the package, its tests, benchmarks and examples, room by room.

    python benchmarks/size.py [--rooms]

Blank lines, comments and docstrings do not count.
"""

from __future__ import annotations

import ast
import io
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("feeder_sim", "tests", "benchmarks", "docs/examples", "models")
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


def main(rooms: Annotated[bool, typer.Option(help="also of every folder in the package")] = False) -> None:
    for folder in FOLDERS:
        lines, files = Counter[str](), Counter[str]()
        for file in sorted((ROOT / folder).rglob("*.py")):
            room = file.relative_to(ROOT / folder).parts[0]
            lines[room] += code_lines(file.read_text())
            files[room] += 1
        print(f"{folder:<24} {lines.total():6d} lines in {files.total():3d} files")
        for room, count in lines.most_common() if rooms and folder == "feeder_sim" else ():
            print(f"  {room:<22} {count:6d} lines in {files[room]:3d} files")


if __name__ == "__main__":
    typer.run(main)
