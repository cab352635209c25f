"""The documents of this repository, and their fenced blocks."""

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HOW_TO = sorted((ROOT / "docs" / "how-to").glob("*.md"))
PAGES = sorted((ROOT / "docs").glob("*.md"))
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *PAGES, *HOW_TO]

_BLOCK = re.compile(r"^```([^\n`]*)\n(.*?)^```$", re.M | re.S)
_NAMED_ABOVE = re.compile(r"`([^`\s]+)`:\s*\Z")


@dataclass(frozen=True, slots=True)
class Block:
    """A fenced block.

    `language` is the first word after the fence, `note` the others, such as a name or ``slow``.
    `file` is the note, or the path of a line "`path`:" right above; `line` is the fence's, from 1.
    """

    language: str
    note: str
    file: str
    line: int
    text: str


def blocks(text):
    """All fenced blocks of a page, in order."""
    found = []
    for match in _BLOCK.finditer(text):
        language, _, note = match[1].strip().partition(" ")
        above = _NAMED_ABOVE.search(text, 0, match.start())
        file = note if re.search(r"[./]", note) else above[1] if above else ""
        found.append(Block(language, note, file, text.count("\n", 0, match.start()) + 1, match[2]))
    return found


def run_python(page, block):
    """Run a block in a namespace of its own; errors name the page's line."""
    code = compile("\n" * block.line + block.text, str(page), "exec")
    exec(code, {"__name__": "__main__"})
