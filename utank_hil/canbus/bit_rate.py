"""Bit rate of a CAN interface, as its kernel has it."""

import json
import subprocess


def why_other_bit_rate(channel: str, bit_rate: int) -> str:
    """Return why an interface does not run at a bit rate; empty if it does.

    Also empty where `ip` (iproute2) tells none: it is missing, or the interface is virtual.
    """
    words = ["ip", "-details", "-json", "link", "show", channel]
    try:
        said = subprocess.run(words, capture_output=True, check=True, timeout=5).stdout
        found = int(json.loads(said)[0]["linkinfo"]["info_data"]["bittiming"]["bitrate"])
    except (OSError, subprocess.SubprocessError, ValueError, LookupError, TypeError):
        return ""
    if found == bit_rate:
        return ""
    return (
        f"is {bit_rate}, but {channel} runs at {found}: load and delay would be judged by the "
        f"wrong one; give both the same (ip link set {channel} type can bitrate {bit_rate})"
    )
