"""What the docs say to type works, and what they link to is there.

Commands are the lines of blocks marked `sh`. A block that begins with `# takes minutes` is only looked at: its command,
options and files exist. All others run, page by page, in a copy of what they need.
"""

from __future__ import annotations

import contextlib
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import get_args

import pytest
from command_line import feeder_sim
from conftest import REPOSITORY
from test_screenshot import DRIVERS

from feeder_sim.cli.files import Set
from feeder_sim.run.prepare import prepare
from feeder_sim.scenario import load_scenario

PAGES = ["README.md", "CONTRIBUTING.md", *sorted(f"docs/{page.name}" for page in REPOSITORY.glob("docs/*.md"))]
# Whose links are looked at, too.
MORE_PAGES = ["CHANGELOG.md", "models/README.md", "benchmarks/peers/README.md", "conformance/README.md"]
COPIED = ("scenarios", "models", "docs/tutorial", "docs/examples", "benchmarks/validation", "conformance")
SCRIPTS = ("benchmarks/", "conformance/", "docs/figures/", "docs/examples/")
SLOW = "# takes minutes"
PROGRAMS = ("feeder-sim", ".venv/bin/feeder-sim")
# What these do is tested elsewhere, or is not for a test to do: they install, open a window, or run the tests.
SKIPPED = (
    "python3 -m venv",
    ".venv/bin/pip",
    ".venv/bin/uv",
    "pip",
    "git",
    "pytest",
    ".venv/bin/pytest",
    "FEEDER_SIM_COMPILE=1 .venv/bin/pytest",
    ".venv/bin/python -m feeder_sim.machine_code.build",
    "ruff",
    "make",
    "mypy",
    "lint-imports",
    "tombi",
    "sphinx-build",
    ".venv/bin/sphinx-build",
)


@dataclass(frozen=True)
class Command:
    """A command of the docs, as words; `at` says where it stands."""

    words: tuple[str, ...]
    at: str
    slow: bool

    @property
    def options(self) -> list[str]:
        return [word.split("=")[0] for word in self.words if word.startswith("-") and not _is_number(word)]

    @property
    def program(self) -> tuple[str, ...]:
        """The command without its arguments as this interpreter runs it; empty where it does not."""
        if self.words[0] in PROGRAMS:
            return sys.executable, "-m", "feeder_sim"
        if self.words[0] == "python" and self.words[1:2] and self.words[1].startswith(SCRIPTS):
            return (sys.executable,)
        return ("cp",) if self.words[0] == "cp" else ()

    @property
    def skipped(self) -> bool:
        """Whether the command is one of SKIPPED, or the viewer."""
        line = " ".join(self.words) + " "
        viewer = self.words[1:2] == ("replay",) and "--screenshot" not in self.words
        return viewer or any(line.startswith(f"{begin} ") for begin in SKIPPED)

    def __str__(self) -> str:
        return f"{self.at}: {' '.join(self.words)}"


def _is_number(word: str) -> bool:
    with contextlib.suppress(ValueError):
        float(word)
        return True
    return False


def blocks(page: str, kind: str) -> Iterator[tuple[int, list[str]]]:
    """Fenced blocks of a kind: number of the first line, and the lines."""
    found: list[str] | None = None
    start = 0
    for number, line in enumerate((REPOSITORY / page).read_text(encoding="utf-8").splitlines(), 1):
        if found is None and line.strip() == f"```{kind}":
            found, start = [], number + 1
        elif found is not None and line.strip() == "```":
            yield start, found
            found = None
        elif found is not None:
            found.append(line)
    assert found is None, f"{page}:{start}: the block has no end"


def commands(page: str, kind: str = "sh") -> list[Command]:
    """All commands of a page in order; those joined by && one by one."""
    found = []
    for start, lines in blocks(page, kind):
        slow = bool(lines) and lines[0] == SLOW
        for number, line in enumerate(lines, start):
            words = shlex.split(line, comments=True)
            while words:
                end = words.index("&&") if "&&" in words else len(words)
                found.append(Command(tuple(words[:end]), f"{page}:{number}", slow))
                words = words[end + 1 :]
    return found


def inline_commands(page: str) -> list[Command]:
    """Commands within the text, and those of blocks marked `text`."""
    text = (REPOSITORY / page).read_text(encoding="utf-8")
    lines = re.findall(r"`(feeder-sim [^`]+)`", text)
    lines += [line for _, block in blocks(page, "text") for line in block if line.startswith("feeder-sim ")]
    return [Command(tuple(shlex.split(line)), page, True) for line in lines]


@cache
def options_of(*command: str) -> frozenset[str]:
    """All options that the help of a command lists."""
    done = feeder_sim(*command, "--help")
    assert done.returncode == 0, f"there is no command {command}"
    return frozenset(re.findall(r"(?<![\w-])--?[a-z][a-z-]*", done.stdout))


def check_arguments(command: Command) -> None:
    """Every option of a feeder-sim command exists; words in capitals stand for something else."""
    if command.words[1:] == ("--help",) or command.words[1] == "COMMAND":
        return
    name = command.words[1 : 3 if command.words[1:3] == ("modes", "import") else 2]
    allowed = options_of(*(word for word in name if not word.startswith("-")))
    for option in command.options:
        assert option in allowed, f"{command}: no option {option}, there are {', '.join(sorted(allowed))}"


def check_files(command: Command) -> None:
    """Files of the repository that a command names exist."""
    for word in command.words[1:]:
        if word.split("/")[0] in ("scenarios", "models", "benchmarks", "tests") or word.endswith(".py"):
            assert (REPOSITORY / word).exists(), f"{command}: there is no {word}"


def test_there_are_commands() -> None:
    """The blocks are found at all; the figures are those of the present docs, rounded down."""
    found = [command for page in PAGES for command in commands(page)]
    assert len(found) > 50
    assert sum(command.slow for command in found) > 20
    assert sum(bool(command.program) and not command.slow for command in found) > 15


@pytest.mark.parametrize("page", PAGES)
def test_every_command_of_the_docs_is_known(page: str) -> None:
    """A new kind of command has to be run, or put on the list of those that are not."""
    for command in commands(page):
        assert command.skipped or command.program, f"{command}: neither run nor skipped by this test"


@pytest.mark.parametrize("page", PAGES)
def test_commands_of_the_docs_have_these_options_and_files(page: str) -> None:
    for command in [*commands(page), *inline_commands(page)]:
        check_files(command)
        if command.words[0] in PROGRAMS:
            check_arguments(command)


@pytest.mark.parametrize("page", PAGES)
def test_brackets_of_commands_are_quoted(page: str) -> None:
    """Some shells, as zsh, read them as a pattern, and refuse a command of which no file has the name."""
    text = (REPOSITORY / page).read_text(encoding="utf-8")
    for line in re.findall(r"(?:feeder-sim|--set\b|--vary|--over)[^`\n]*", text):
        assert not re.search(r"\w\[\d+\][\w.]*=", re.sub(r"\"[^\"]*\"|'[^']*'", "", line)), f"{page}: {line}"


def test_brackets_of_the_help_are_quoted() -> None:
    assert "'drive[0].amplitude_um=2'" in get_args(Set)[1].help


def test_tests_that_the_docs_choose_by_name_exist() -> None:
    names = {
        name
        for file in REPOSITORY.glob("tests/**/test_*.py")
        for name in re.findall(r"def (test_\w+)", file.read_text(encoding="utf-8"))
    }
    chosen = [c.words[c.words.index("-k") + 1] for page in PAGES for c in commands(page) if "-k" in c.words]
    assert chosen
    for part in chosen:
        assert any(part in name for name in names), f"no test has {part} in its name"


def documented_scripts() -> dict[str, list[Command]]:
    """Commands by the script that they run."""
    found: dict[str, list[Command]] = {}
    for page in PAGES:
        for command in commands(page):
            if command.words[0] == "python":
                found.setdefault(command.words[1], []).append(command)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("script", sorted(documented_scripts()))
def test_benchmarks_of_the_docs_have_these_options(script: str) -> None:
    """Only scripts that are called with options are asked for them: others may have no help, and begin to work."""
    used = {option: command for command in documented_scripts()[script] for option in command.options}
    if not used:
        compile((REPOSITORY / script).read_text(encoding="utf-8"), script, "exec")
        return
    line = [sys.executable, script, "--help"]
    done = subprocess.run(line, cwd=REPOSITORY, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    listed = set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", done.stdout))
    for option, command in used.items():
        assert option in listed, f"{command}: no option {option}"


@pytest.fixture
def workplace(tmp_path: Path) -> Path:
    """What a clone holds, as far as commands read it."""
    for name in COPIED:
        shutil.copytree(REPOSITORY / name, tmp_path / name)
    return tmp_path


def to_run(page: str) -> list[Command]:
    return [command for command in commands(page) if not command.slow and not command.skipped]


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if to_run(page)])
def test_commands_of_a_page_run_in_its_order(page: str, workplace: Path) -> None:
    drivers = any(DRIVERS.glob("*.json"))
    for command in to_run(page):
        if "--screenshot" in command.words and not drivers:
            continue  # no graphics driver, not even a software one
        line = [*command.program, *command.words[1:]]
        done = subprocess.run(line, cwd=workplace, capture_output=True, text=True, timeout=600, check=False)
        assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"


@pytest.mark.parametrize(
    ("page", "start"),
    [(page, start) for page in PAGES for start, _ in blocks(page, "python")],
)
def test_python_of_the_docs_runs(page: str, start: int, workplace: Path) -> None:
    (lines,) = [lines for first, lines in blocks(page, "python") if first == start]
    with contextlib.chdir(workplace):
        exec(compile("\n".join(lines), f"{page}:{start}", "exec"), {"__name__": "__main__"})


def test_scenarios_of_those_who_come_from_elsewhere_are_accepted(workplace: Path) -> None:
    found = list(blocks("docs/coming_from.md", "toml"))
    assert found
    for start, lines in found:
        file = workplace / "scenarios" / f"line_{start}.toml"
        file.write_text("\n".join(lines), encoding="utf-8")
        prepare(load_scenario(file))


LINK = re.compile(r"!?\[[^\]]*\]\(([^()\s]+)\)")
DIRECTIVE = re.compile(r"^```\{(?:literalinclude|include|image|figure)\} (\S+)", re.MULTILINE)


def anchors(page: Path) -> set[str]:
    """Places of a page that a link can point at, as GitHub and MyST name them."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", [*PAGES, *MORE_PAGES])
def test_links_of_the_docs_lead_somewhere(page: str) -> None:
    text = (REPOSITORY / page).read_text(encoding="utf-8")
    for target in [*LINK.findall(text), *DIRECTIVE.findall(text)]:
        if re.match(r"[a-z]+:", target):  # another site
            continue
        name, _, anchor = target.partition("#")
        file = (REPOSITORY / page).parent / name if name else REPOSITORY / page
        assert file.exists(), f"{page}: there is no {target}"
        if anchor:
            assert anchor in anchors(file), f"{page}: there is no {target}"


@pytest.mark.parametrize("page", PAGES)
def test_files_that_the_docs_name_exist(page: str) -> None:
    """Paths within the text, from the root of the repository."""
    text = (REPOSITORY / page).read_text(encoding="utf-8")
    for name in re.findall(r"`((?:scenarios|models|benchmarks|tests|docs|feeder_sim)/[\w./-]+)`", text):
        assert (REPOSITORY / name).exists(), f"{page}: there is no {name}"
