"""The result of the fault campaign as JUnit XML, which continuous integration shows."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from utank_hil.base.whole_file import write_whole


def write_junit(path: Path, content: dict[str, Any]) -> None:
    """Write what `verdict.as_json` gives: a test case for each row, skipped if it was not run."""
    counts = {
        "tests": len(content["rows"]) + len(content["not_run"]),
        "failures": content["failed"],
        "skipped": len(content["not_run"]),
    }
    suite = ElementTree.Element("testsuite", name="faults")
    suite.attrib |= {name: str(count) for name, count in counts.items()}
    for row in content["rows"]:
        case = ElementTree.SubElement(suite, "testcase", classname="faults", name=row["id"])
        if row["verdict"] != "pass":
            failure = ElementTree.SubElement(case, "failure", message=row.get("requirement", ""))
            failure.text = "\n".join(row["problems"])
    for each in content["not_run"]:
        case = ElementTree.SubElement(suite, "testcase", classname="faults", name=each["id"])
        ElementTree.SubElement(case, "skipped", message=each["why"])
    write_whole(path, ElementTree.tostring(suite, encoding="unicode", xml_declaration=True))
