"""The structure of the package: what import-linter's contracts do not say."""

from __future__ import annotations

import grimp
import networkx as nx


def test_no_files_import_each_other() -> None:
    """By however many steps, those within functions included; names of types alone do not count."""
    graph = grimp.build_graph("feeder_sim", exclude_type_checking_imports=True)
    imports = nx.DiGraph((a, b) for a in graph.modules for b in graph.find_modules_directly_imported_by(a))
    assert [sorted(circle) for circle in nx.strongly_connected_components(imports) if len(circle) > 1] == []
