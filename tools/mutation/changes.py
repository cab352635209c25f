"""Lines of the safety code that differ from a commit, or from the code that was judged."""

import json
import re
import subprocess

from tools.evidence.sources import ROOT
from tools.mutation.mutants import Mutant

RECORD = ROOT / "docs" / "evidence" / "mutation.json"
_HUNK = re.compile(r"^@@ .* \+(\d+)(?:,(\d+))? @@", re.M)


def git(*words: str) -> str:
    """What git prints; empty if it fails."""
    return subprocess.run(
        ["git", *words], cwd=ROOT, capture_output=True, text=True, check=False
    ).stdout.strip()


def blob_of(file: str) -> str:
    """Name that git has for the content of a file as it is."""
    return git("hash-object", file)


def _lines(diff: str) -> set[int]:
    hunks = _HUNK.findall(diff)
    return {int(first) + i for first, count in hunks for i in range(int(count or 1))}


def changed_since(base: str, file: str, mutants: list[Mutant]) -> list[Mutant]:
    """Mutants of the lines that are not as in the common ancestor with a commit."""
    lines = _lines(git("diff", "-U0", git("merge-base", base, "HEAD"), "--", file))
    return [mutant for mutant in mutants if mutant.line in lines]


def not_judged(file: str, mutants: list[Mutant]) -> list[Mutant]:
    """Mutants that the evidence did not try: of other lines, or for want of time.

    All of them where there is no evidence, or where this clone does not have what it judged.
    """
    try:
        files = json.loads(RECORD.read_text(encoding="utf-8"))["result"]["files"]
    except FileNotFoundError:
        return mutants
    judged = {entry["file"]: entry for entry in files}.get(file)
    if judged is None or not git("cat-file", "-t", judged["blob"]):
        return mutants
    lines = _lines(git("diff", "-U0", judged["blob"], file))
    untried = set(judged["not_tried"])
    return [mutant for mutant in mutants if mutant.line in lines or mutant.key in untried]
