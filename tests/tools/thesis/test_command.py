import json

import pytest
import typer
from typer.testing import CliRunner

from tools.thesis.__main__ import reproduce


@pytest.fixture
def application():
    made = typer.Typer()
    made.command()(reproduce)
    return made


@pytest.mark.evidence
def test_chosen_figures_are_drawn_listed_and_put_on_one_page(application, tmp_path):
    done = CliRunner().invoke(application, ["2.7", "2.1", "--out", str(tmp_path), "--json"])
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    sketch, figure = found["figures"]
    assert figure["key"] == "2.7"
    assert sketch == {
        "key": "2.1", "title": "Active U-tube tank", "word": "sketch of ship and tank"
    }  # fmt: skip
    assert found == json.loads((tmp_path / "figures.json").read_text(encoding="utf-8"))
    page = (tmp_path / "gallery.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 1
    assert "http" not in page  # nothing from the network
    for row in figure["rows"]:
        assert row["quantity"] in page
    for check in figure["checks"]:
        assert check["verdict"] in page
    assert (tmp_path / "2.7.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.evidence
def test_the_table_has_a_line_for_each_figure(application, tmp_path):
    done = CliRunner(env={"COLUMNS": "160"}).invoke(
        application, ["2.7", "2.2", "--out", str(tmp_path)]
    )
    assert done.exit_code == 0
    assert "Stimulator moment per pump power" in done.stdout
    assert "block diagram" in done.stdout
    assert "gallery.html" in done.stdout


def test_list_makes_nothing(application, tmp_path):
    out = tmp_path / "not made"
    done = CliRunner().invoke(application, ["--list", "--out", str(out)])
    assert done.exit_code == 0
    assert "2.7" in done.stdout
    listed = json.loads(CliRunner().invoke(application, ["--list", "--json"]).stdout)
    assert {"key": "2.2", "title": "Inner pressure loop", "word": "block diagram"} in listed[
        "figures"
    ]
    assert not out.exists()


def test_unknown_figures_and_bad_folders_are_refused(application, tmp_path):
    unknown = CliRunner().invoke(application, ["2.99"])
    assert unknown.exit_code == 2
    assert "no figure '2.99'; --list shows all of them" in unknown.stderr
    (tmp_path / "file").touch()
    folder = CliRunner().invoke(application, ["2.7", "--out", str(tmp_path / "file")])
    assert folder.exit_code == 2
    assert "choose another folder with --out" in folder.stderr
