"""The generated documents are fresh, and the check of that can fail."""

import pytest

from tools.documents import tables, write


def test_the_documents_are_those_of_the_code():
    assert write.main(["--check"]) == 0


def test_a_stale_table_is_found_and_written_anew(tmp_path, monkeypatch):
    text = (tables.DOCS / "safety.md").read_text(encoding="utf-8")
    page = tmp_path / "safety.md"
    page.write_text(text.replace("older than 40 ms", "older than 30 ms"), encoding="utf-8")
    monkeypatch.setattr(write, "TABLES", {page: tables.faults})
    monkeypatch.setattr(write, "WHOLE", {})
    assert write.main(["--check"]) == 1
    assert write.main([]) == 0
    assert page.read_text(encoding="utf-8") == text


def test_a_page_without_its_marks_is_refused(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# Safety\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"page\.md: generated tables must stand between"):
        tables.written_anew(page, tables.faults())
