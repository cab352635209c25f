"""Texts of others are read alike: byte order marks, line ends, gzip, sizes, damaged ends."""

import bz2
import csv
import gzip
import zlib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.base.text_files import (
    LINE_LIMIT,
    TextFileError,
    kind_of,
    lines_of,
    open_content,
    open_text,
)

TEXT = "time_s,Süd\n1,2\n3,4\n"


def written(folder, content, name="a.csv"):
    path = folder / name
    path.write_bytes(content)
    return path


def read(path):
    with open_text(path) as text:
        return text.read()


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("packed", [bytes, gzip.compress])
def test_line_ends_marks_and_gzip_make_no_difference(tmp_path, end, encoding, packed):
    path = written(tmp_path, packed(TEXT.replace("\n", end).encode(encoding)))
    assert read(path) == TEXT
    with open_text(path) as text:
        assert [line for _, line in lines_of(path, text)] == TEXT.splitlines(keepends=True)
    with open_text(path) as text:
        assert list(csv.reader(text)) == [["time_s", "Süd"], ["1", "2"], ["3", "4"]]


@pytest.mark.parametrize(
    ("name", "kind"),
    [("a.LOG", ".log"), ("a.b.Csv.GZ", ".csv"), ("a", ""), ("a.gz", ""), (".log", "")],
)
def test_the_kind_of_a_file_is_its_suffix_before_gz(name, kind):
    assert kind_of(Path(name)) == kind


def test_members_of_an_archive_and_zeros_after_it_are_read_as_gzip_does(tmp_path):
    packed = gzip.compress(b"one\n") + gzip.compress(b"two\n") + bytes(512)
    path = written(tmp_path, packed)
    assert read(path) == "one\ntwo\n" == gzip.decompress(packed).decode()


@given(content=st.binary(max_size=400), cut=st.integers(0, 200), flip=st.integers(0, 200))
def test_a_damaged_archive_is_read_up_to_there_and_said_so(tmp_path_factory, content, cut, flip):
    packed = bytearray(gzip.compress(content, mtime=0))
    cut %= len(packed)
    path = tmp_path_factory.getbasetemp() / "cut.gz"
    path.write_bytes(packed[:cut])
    said: list[str] = []
    with open_content(path, on_cut=said.append) as file:
        found = file.read()
    if cut >= 2:
        assert content.startswith(found)
        assert [each.startswith("cut.gz is cut near byte") for each in said] == [True]
        with pytest.raises(TextFileError, match=r"cut\.gz is cut"), open_content(path) as file:
            file.read()
    packed[10 + flip % (len(packed) - 10)] ^= 0x41
    path.write_bytes(packed)
    said.clear()
    with open_content(path, on_cut=said.append) as file:
        assert file.read() == content or said


def test_a_small_file_of_great_content_is_refused_with_the_limit(tmp_path):
    path = written(tmp_path, gzip.compress(bytes(1 << 24)))
    assert path.stat().st_size < 20_000
    with (
        open_content(path, limit_bytes=1 << 20) as file,
        pytest.raises(TextFileError, match="holds more than 1048576 bytes"),
    ):
        file.read()
    with open_text(path) as text, pytest.raises(TextFileError, match="line 1 has more than"):
        list(lines_of(path, text))
    with open_text(written(tmp_path, b"x" * (LINE_LIMIT - 2) + b"\n")) as text:
        assert len(list(lines_of(path, text))) == 1


@pytest.mark.parametrize("content", [b"\xe9t\xe9\n", b"\xff\xfea", bz2.compress(b"a"), b"\x80"])
def test_other_encodings_are_refused_with_the_remedy(tmp_path, content):
    with pytest.raises(TextFileError, match=r"a\.csv: is no text in UTF-8"):
        read(written(tmp_path, content))


def test_compressed_content_is_that_of_zlib(tmp_path):
    content = bytes(range(256)) * 3000
    packer = zlib.compressobj(wbits=31)
    path = written(tmp_path, packer.compress(content) + packer.flush())
    with open_content(path) as file:
        assert file.read() == content
