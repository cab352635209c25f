"""A bench without room in the memory that processes share ends with the code of the system."""

import errno
from types import SimpleNamespace
from typing import Any

import pytest
import typer

from firmware_sim import bench as bench_module
from firmware_sim.commands import bench
from utank_hil.console.exit_codes import ExitCode
from utank_hil.telemetry.ring import RingError


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (RingError("no room for 2100288 bytes in /dev/shm"), ExitCode.SYSTEM),
        (OSError(errno.ENOSPC, "No space left on device"), ExitCode.SYSTEM),
        (OSError(errno.ENOSPC, "No space left on device", "out/x.frames"), ExitCode.USAGE),
    ],
)
def test_the_place_that_is_full_is_named(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    error: OSError,
    code: ExitCode,
) -> None:
    def full(*_: object) -> None:
        raise error

    monkeypatch.setattr(bench_module, "run_bench", full)
    nothing: Any = SimpleNamespace(duration_s=1.0, controllers=())
    options: Any = SimpleNamespace(duration_s=None, channel=None)
    with pytest.raises(typer.Exit) as ending:
        bench._run(nothing, options, {})
    assert ending.value.exit_code == code
    assert ("/dev/shm" in capsys.readouterr().err) == (code is ExitCode.SYSTEM)
