"""The structure of the package: what import-linter's contracts do not say."""

from __future__ import annotations

import ast
import tomllib
from collections import Counter
from collections.abc import Iterator

import grimp
import networkx as nx
from conftest import REPOSITORY, subjects


def test_no_files_import_each_other() -> None:
    """By however many steps, those within functions included; names of types alone do not count."""
    graph = grimp.build_graph("feeder_sim", exclude_type_checking_imports=True)
    imports = nx.DiGraph((a, b) for a in graph.modules for b in graph.find_modules_directly_imported_by(a))
    assert [sorted(circle) for circle in nx.strongly_connected_components(imports) if len(circle) > 1] == []


def test_subjects_name_files_that_there_are_and_none_twice() -> None:
    listed = [
        REPOSITORY / "tests" / folder / f"test_{name}.py"
        for table in subjects().values()
        for folder, names in table.items()
        if folder != "about"
        for name in names
    ]
    assert [file for file in listed if not file.is_file()] == []
    assert len(set(listed)) == len(listed) > 50


def names_in(source: str) -> Iterator[str]:
    """Names that a source gives: of functions, classes, arguments and variables."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id
        elif isinstance(node, ast.arg):
            yield node.arg


def test_names_are_of_the_field_and_private_words_only_get_fewer() -> None:
    listed: dict[str, int] = tomllib.loads((REPOSITORY / "tests/private_words.toml").read_text(encoding="utf-8"))
    counts = Counter(
        word
        for file in (REPOSITORY / "feeder_sim").rglob("*.py")
        for name in names_in(file.read_text(encoding="utf-8"))
        for word in listed.keys() & set(name.lower().split("_"))
    )
    assert {word: counts[word] for word in listed} == listed
