"""Telemetry: a shared-memory ring out of the loop, Rerun recordings and a live view.

The ring imports little and may be used by the controller process. Modules that need Rerun are
imported when a name of theirs is first used; so is the recorder, which is also run as a module.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from utank_hil.telemetry.event_ring import EventReader, EventWriter, event_text
from utank_hil.telemetry.ring import RingError, RingReader, RingWriter
from utank_hil.telemetry.rotation import Rotation
from utank_hil.telemetry.viewer import Viewer, open_viewer

if TYPE_CHECKING:
    from utank_hil.telemetry.recorder import RecorderError, RecorderProcess, RecorderReport
    from utank_hil.telemetry.recording import read_about, read_recording, write_recording
    from utank_hil.telemetry.signal_files import read_signals

__all__ = [
    "EventReader",
    "EventWriter",
    "RecorderError",
    "RecorderProcess",
    "RecorderReport",
    "RingError",
    "RingReader",
    "RingWriter",
    "Rotation",
    "Viewer",
    "event_text",
    "open_viewer",
    "read_about",
    "read_recording",
    "read_signals",
    "write_recording",
]

_LAZY = {
    "RecorderError": "recorder",
    "RecorderProcess": "recorder",
    "RecorderReport": "recorder",
    "read_about": "recording",
    "read_recording": "recording",
    "read_signals": "signal_files",
    "write_recording": "recording",
}


def __getattr__(name: str) -> object:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_LAZY[name]}"), name)
