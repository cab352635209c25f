"""The pages keep their form, and what they name exists."""

import ast
import pkgutil
import re

import pytest
from pages import DOCUMENTS, HOW_TO, PAGES, ROOT, blocks

PARTS = ["What it does", "How to use it", "What was measured"]
FOLDERS = [ROOT, *(ROOT / name for name in ("utank_hil", "firmware_sim"))]
ROOMS = ["utank_hil", *(each.parent.name for each in (ROOT / "utank_hil").glob("*/__init__.py"))]
MOST_COLUMNS = 100


def written(page):
    """Numbered lines of a page that somebody wrote: no tables, fenced blocks, generated parts."""
    fenced = generated = False
    lines = []
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        if line.startswith("```"):
            fenced = not fenced
        elif line.startswith("<!-- "):
            generated = not line.lower().startswith("<!-- end")
        elif not (fenced or generated or line.startswith(("|", "!["))):
            lines.append((number, line))
    return lines


def found(path):
    """The file of a path as documents write it: from the root, or within a package."""
    return next((folder / path for folder in FOLDERS if (folder / path).exists()), None)


def names_of(file):
    """Names of a module: ``thing``, ``Class``, ``Class.member``; of other files, all words."""
    text = file.read_text(encoding="utf-8")
    if file.suffix != ".py":
        return set(re.findall(r"[\w.]*\w", text))
    names = set()

    def collect(body, owner):
        for node in body:
            if isinstance(node, ast.ClassDef | ast.FunctionDef):
                names.add(owner + node.name)
            elif isinstance(node, ast.AnnAssign):
                names.add(owner + ast.unparse(node.target))
            elif isinstance(node, ast.Assign):
                names.update(owner + ast.unparse(target) for target in node.targets)
            if isinstance(node, ast.ClassDef):
                collect(node.body, f"{node.name}.")
                for method in node.body:
                    if isinstance(method, ast.FunctionDef) and method.name == "__init__":
                        collect(method.body, f"{node.name}.__init__.")

    collect(ast.parse(text).body, "")
    return names | {name.replace(".__init__.self.", ".") for name in names}


def is_name(dotted):
    """Whether a dotted name, from a room or in full, can be imported."""
    for full in (f"utank_hil.{dotted}", dotted):
        try:
            pkgutil.resolve_name(full)
        except (ImportError, AttributeError):
            continue
        return True
    return False


def missing(names, path):
    """Those of `names` that the file has not; the path itself if there is no such file."""
    file = found(path)
    return [path] if file is None else [name for name in names if name not in names_of(file)]


WHERE = re.findall(
    r"^\|[^|]*\| `([^`]+)` \| `([^`]+)` \|$", (ROOT / "docs/README.md").read_text(), re.M
)
MEANT = [
    (re.findall(r"`([^`]+)`", names), path)
    for names, path in re.findall(
        r"((?:`[^`]+`(?:, )?(?:[a-z ]+)?)+) in `([^`]+)`", (ROOT / "docs/glossary.md").read_text()
    )
]


@pytest.mark.parametrize("page", [*PAGES, *HOW_TO], ids=lambda page: page.stem)
def test_a_page_has_three_parts(page):
    if page.stem not in ("README", "api", "configuration", "glossary", "index", "results"):
        headings = re.findall(r"^## (.*)$", page.read_text(encoding="utf-8"), re.M)
        assert headings[:3] == PARTS


@pytest.mark.parametrize("page", DOCUMENTS, ids=lambda page: page.stem)
def test_lines_are_short_but_in_tables(page):
    assert [number for number, line in written(page) if len(line) > MOST_COLUMNS] == []


@pytest.mark.parametrize("page", DOCUMENTS, ids=lambda page: page.stem)
def test_links_lead_to_files(page):
    links = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    assert [link for link in links if not (page.parent / link).exists()] == []


@pytest.mark.parametrize("page", DOCUMENTS, ids=lambda page: page.stem)
def test_files_and_names_on_a_page_exist(page):
    text = page.read_text(encoding="utf-8")
    made = {block.file for block in blocks(text)}
    made |= set(re.findall(r"^--- (\S+)$", text, re.M))  # by the changes that a page shows
    paths = re.findall(r"`((?:[\w.-]+/)+[\w.-]+\.(?:py|dbc|md|toml|yaml))`", text)
    modules = [name.replace(".", "/") for name in re.findall(r"-m (tools\.[\w.]+)", text)]
    paths += [f"{name}{'/__main__' if (ROOT / name).is_dir() else ''}.py" for name in modules]
    assert [path for path in paths if not (path in made or found(path))] == []
    tests = re.findall(r"`(test_\w+\.py)`", text)
    assert [name for name in tests if not list((ROOT / "tests").rglob(name))] == []
    # keys of files may begin as rooms do
    names = (
        []
        if page.stem == "configuration"
        else re.findall(rf"`((?:{'|'.join(ROOMS)})\.[\w.]+)", text)
    )
    assert [name for name in names if not is_name(name)] == []


def test_the_table_of_places_is_right():
    assert len(WHERE) > 25
    assert [missing([name], path) for path, name in WHERE if missing([name], path)] == []


def test_the_glossary_s_places_are_right():
    assert len(MEANT) > 40
    assert [missing(names, path) for names, path in MEANT if missing(names, path)] == []


def test_a_wrong_place_is_found():
    limiter = "control/limiter.py"
    assert missing(["CommandLimiter._barrier_pa"], limiter) == []
    assert missing(["PumpLimits.level_m"], "control/interface.py") == []
    assert missing(["CommandLimiter.command_pa"], limiter) == []
    assert missing(["barrier_pa", "CommandLimiter.barrier"], limiter) != []
    assert missing(["x"], "control/nothing.py") == ["control/nothing.py"]
    assert missing(["SENSOR_MOTION"], "canbus/utank.dbc") == []
    assert is_name("analysis.loop.margins.margins")
    assert not is_name("analysis.margins.margins")
