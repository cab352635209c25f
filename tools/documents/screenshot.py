"""Take a picture of a recording, or of a live stream, as the Rerun viewer shows it.

Usage: python -m tools.documents.screenshot SOURCE PICTURE.png [WIDTHxHEIGHT]

SOURCE is an .rrd file or the URL of a live stream. Needs a Vulkan driver, for which a software
renderer will do: Mesa's (Debian package mesa-vulkan-drivers), or the one that Debian's chromium
brings. What the viewer complains of goes to standard error and makes the exit code 1.
"""

import filecmp
import os
import subprocess
import sys
import time
from pathlib import Path

from rerun.experimental import ViewerClient

from utank_hil.telemetry.viewer import (
    LOOPBACK,
    hold_port,
    live_url,
    port_of,
    rerun_binary,
    rerun_environment,
)

STARTS_S = 60.0
SETTLE_S = 1.5  # for loading and for the next frames; the viewer does not tell
DRIVERS = (Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d"))
CHROMIUM = Path("/usr/lib/chromium")


def main(source: str, picture: str, size: str = "1600x1000") -> int:
    """Start a viewer without a window, show the source, save the picture."""
    with hold_port() as held:
        port = port_of(held)
        command = [rerun_binary(), "--headless", "--bind", LOOPBACK, "--port", str(port)]
        viewer = subprocess.Popen(
            [*command, "--window-size", size, source],
            env=rerun_environment() | software_renderer() | {"RUST_LOG": "error"},
        )
        try:
            client = _connected(viewer, port)
            path, before = Path(picture).absolute(), Path(f"{picture}.before").absolute()
            for left in (path, before):
                left.unlink(missing_ok=True)
            while not (before.exists() and filecmp.cmp(path, before, shallow=False)):
                if path.exists():
                    path.replace(before)
                time.sleep(SETTLE_S)
                client.save_screenshot(str(path))
            before.unlink()
            complaints = [report for view in client.get_state().views for report in view.reports]
        finally:
            viewer.terminate()
            viewer.wait()
    for complaint in complaints:
        print(complaint, file=sys.stderr)
    return 1 if complaints else 0


def software_renderer() -> dict[str, str]:
    """Environment with the renderer of chromium, where there is no driver but that one."""
    renderer = CHROMIUM / "vk_swiftshader_icd.json"
    if any(driver for folder in DRIVERS for driver in folder.glob("*.json")):
        return {}
    if not renderer.exists():
        return {}
    paths = [str(CHROMIUM), *filter(None, [os.environ.get("LD_LIBRARY_PATH")])]
    return {"VK_DRIVER_FILES": str(renderer), "LD_LIBRARY_PATH": ":".join(paths)}


def _connected(viewer: "subprocess.Popen[bytes]", port: int) -> ViewerClient:
    """The viewer, once it answers."""
    deadline = time.monotonic() + STARTS_S
    while True:
        try:
            return ViewerClient.connect(live_url(port))
        except ConnectionError:
            if viewer.poll() is not None:
                sys.exit("the viewer failed; what it says is above")
            if time.monotonic() > deadline:
                raise
            time.sleep(0.2)


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
