"""The blocks of code on the pages of the documentation."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("pyarrow")
pytest.importorskip("matplotlib")

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r'^```(\w+)(?: title="([^"]*)")?\n(.*?)^```$', re.DOTALL | re.MULTILINE)
DATA = "toml", "yaml", "csv"
#: A script that needs a cluster, which is run by the long proofs.
ENGINE = re.compile(r"^(?:from|import) (dask|ray)\b", re.MULTILINE)


def blocks(page):
    return BLOCK.findall(page.read_text(encoding="utf-8"))


def pages():
    """The pages with a block of Python."""
    found = sorted((ROOT / "docs").rglob("*.md"))
    return [page for page in found if any(language == "python" for language, _, _ in blocks(page))]


def difference(shown, printed):
    """The first line of `shown` that `printed` does not have; … stands for any number of lines, or for a part of one."""
    lines, at, free = [line.split() for line in printed.splitlines() if line.strip()], 0, False
    for line in filter(str.strip, shown.splitlines()):
        if line.strip() == "…":
            free = True
            continue
        pattern = re.compile(".*".join(re.escape(" ".join(part.split())) for part in line.split("…")))
        reach = lines[at:] if free else lines[at : at + 1]
        found = next((k for k, words in enumerate(reach) if pattern.match(" ".join(words))), None)
        if found is None:
            return line
        at, free = at + found + 1, False
    return None


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.stem)
def test_the_blocks_of_a_page_run(page, tmp_path, monkeypatch, capfd):
    """Blocks of a page share their names; one with a title is the file of that name, and a script runs by itself."""
    for name in "datasets", "experiments":
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    names = {"__name__": "page"}
    printed = None
    for language, title, text in blocks(page):
        if title and language in (*DATA, "python"):
            Path(title).write_text(text, encoding="utf-8")
        if language == "python" and title and ENGINE.search(text):
            compile(text, title, "exec")
        elif language == "python" and title:
            subprocess.run([sys.executable, title], check=True, env=os.environ)
        elif language == "python":
            capfd.readouterr()
            exec(compile(text, str(page), "exec"), names)
            printed = capfd.readouterr().out
        elif language == "text" and printed is not None:
            missing = difference(text, printed)
            assert missing is None, f"not printed: {missing}\n{printed}"
            printed = None
        elif language != "toml":
            printed = None


def test_every_page_with_python_is_run():
    assert {"first-fix", "own-component", "property-test", "compare", "cluster", "python"} <= {p.stem for p in pages()}


@pytest.mark.long
@pytest.mark.parametrize("engine", ["dask", "ray"])
def test_the_script_of_an_engine_runs(engine, tmp_path, monkeypatch):
    pytest.importorskip(engine)
    monkeypatch.chdir(tmp_path)
    page = blocks(ROOT / "docs" / "tutorials" / "cluster.md")
    for language, title, text in page:
        if title and language in DATA:
            Path(title).write_text(text, encoding="utf-8")
    found = [(title, text) for _, title, text in page if title and engine in ENGINE.findall(text)]
    assert found
    for title, text in found:
        Path(title).write_text(text, encoding="utf-8")
        subprocess.run([sys.executable, title], check=True, env=os.environ)
