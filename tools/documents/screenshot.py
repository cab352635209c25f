"""Take a picture of a recording, or of a live stream, as the Rerun viewer shows it.

Usage: python -m tools.documents.screenshot SOURCE PICTURE.png [WIDTHxHEIGHT]

SOURCE is an .rrd file or the URL of a live stream. Needs a Vulkan driver, for which Mesa's software
renderer will do (Debian package mesa-vulkan-drivers). What the viewer complains of goes to standard
error and makes the exit code 1.
"""

import subprocess
import sys
import time
from pathlib import Path

from rerun.experimental import ViewerClient

from utank_hil.telemetry.viewer import (
    LOOPBACK,
    free_tcp_port,
    live_url,
    rerun_binary,
    rerun_environment,
)

SETTLE_S = 3.0  # for loading and for the first frames; the viewer does not tell


def main(source: str, picture: str, size: str = "1600x1000") -> int:
    """Start a viewer without a window, show the source, save the picture."""
    port = free_tcp_port()
    command = [rerun_binary(), "--headless", "--bind", LOOPBACK, "--port", str(port)]
    viewer = subprocess.Popen(
        [*command, "--window-size", size, source], env=rerun_environment() | {"RUST_LOG": "error"}
    )
    try:
        time.sleep(SETTLE_S)
        client = ViewerClient.connect(live_url(port))
        client.save_screenshot(str(Path(picture).absolute()))
        complaints = [report for view in client.get_state().views for report in view.reports]
    finally:
        viewer.terminate()
        viewer.wait()
    for complaint in complaints:
        print(complaint, file=sys.stderr)
    return 1 if complaints else 0


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
