"""What the documents and docstrings name exists: files, equations, sections, README commands."""

import re
import shlex
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
METHOD = (ROOT / "docs" / "method.md").read_text(encoding="utf-8")
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
FOLDERS = ("warp_eulsph", "examples", "tests", "docs")
SOURCES = sorted(path for folder in FOLDERS[:3] for path in (ROOT / folder).rglob("*.py"))
EQUATIONS = set(re.findall(r"\((M\d+)\)", METHOD))


# Files that runs and users make.
OF_USERS = {
    "ciarlet.py",
    "foam.py",
    "brittle.py",
    "plate.toml",
    "rigid_floor.py",
    "case.toml",
    "DIR/case.toml",
    "mine.toml",
}


def ids(path):
    return str(path.relative_to(ROOT))


def test_all_equations_are_defined():
    assert {f"M{k}" for k in range(1, 30)} == EQUATIONS


@pytest.mark.parametrize("path", DOCUMENTS, ids=ids)
def test_files_named_in_documents_exist(path):
    text = path.read_text(encoding="utf-8")
    named = re.findall(r"(?<![\w./-])((?:[\w.-]+/)*[\w-]+\.(?:py|md|csv|toml))\b", text)
    named += re.findall(r"`((?:warp_eulsph|examples|tests|docs)/[\w/]*)`", text)
    # Short names stand beside a full one: `correction.py` in a list that began with `warp_eulsph/operators/…`.
    short = {file.name for folder in FOLDERS for file in (ROOT / folder).rglob("*")}
    named = [name for name in named if name not in OF_USERS]
    beside = [name for name in named if "/" in name and (path.parent / name).exists()]  # links between pages
    named = [name for name in named if name not in beside]
    missing = [name for name in named if not (ROOT / name).exists() and ("/" in name or name not in short)]
    assert not missing


@pytest.mark.parametrize("path", [*DOCUMENTS, *SOURCES], ids=ids)
def test_equations_and_sections_cited_are_there(path):
    text = path.read_text(encoding="utf-8")
    cited = set(re.findall(r"(?<![\w.])M\d+(?=[\s,.;:)\]'’])", text))
    assert cited <= EQUATIONS
    for section in re.findall(r"docs/method\.md,? §(\d+)", text):
        assert re.search(rf"^## {section}\. ", METHOD, re.MULTILINE), f"no section {section} in docs/method.md"
    if path != Path(__file__):  # pages that are not part of the project
        assert not re.findall(r"\b(?:METHOD|BENCHMARKS|ARCHITECTURE)\b", text), "cite docs/method.md"


def commands(text):
    """Lines of the README's shell blocks."""
    blocks = re.findall(r"```(?:bash|sh)\n(.*?)```", text, re.DOTALL)
    return [line for block in blocks for line in block.splitlines() if line and not line.startswith("#")]


def test_commands_of_the_readme_name_real_examples():
    lines = commands((ROOT / "README.md").read_text(encoding="utf-8"))
    assert len(lines) >= 2
    for line in lines:
        for word in shlex.split(line):
            if word.startswith(("examples/", "tests/")):
                assert (ROOT / word).exists(), line


def test_every_example_is_in_the_readme():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    runnable = [path for path in (ROOT / "examples").glob("*.py") if "def main(" in path.read_text(encoding="utf-8")]
    assert len(runnable) >= 5
    assert not [path.name for path in runnable if f"examples/{path.name}" not in text]


def test_python_example_of_the_readme_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    exec(compile(code, "README.md", "exec"), {})
    assert list(tmp_path.rglob("*.vtkhdf"))
