"""Command line: choose the way, see that candump is there, run the command."""

import os
import shutil
import sys

from tools.vcan_launcher import debian, native, uml
from tools.vcan_launcher.command import execute

USAGE = """\
usage: tools/vcan [--native|--uml] [--] COMMAND ARGS...

Run COMMAND with a working CAN interface vcan0: on the running kernel if it can provide one, else
inside a user-mode Linux kernel (Debian's user-mode-linux, fetched at first use, no root needed).
Output, input, exit code and signals pass through; can-utils (candump, ...) are on PATH.

  --native   only the running kernel; fail if it cannot
  --uml      only the user-mode kernel
  --help     this text

example:
  tools/vcan sh -c 'candump -n 1 vcan0 & sleep 0.2; cansend vcan0 123#CAFE; wait'
"""


def main(arguments: list[str]) -> int:
    """Run the command line; return the exit code."""
    for fd in range(3):  # a stream that is closed must not come back as one of our pipes
        try:
            os.fstat(fd)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    way = ""
    rest = list(arguments)
    while rest and rest[0].startswith("-"):
        option = rest.pop(0)
        if option == "--":
            break
        if option in ("-h", "--help"):
            print(USAGE, end="")
            return 0
        if option not in ("--native", "--uml") or way:
            return _usage_error(f"unexpected option {option}")
        way = option
    if not rest:
        return _usage_error("no command given")
    try:
        return _run([os.fsencode(argument) for argument in rest], way)
    except (debian.PackageError, native.NativeUnavailableError, uml.KernelError) as error:
        print(f"tools/vcan: {error}", file=sys.stderr)
        return 125


def _run(argv: list[bytes], way: str) -> int:
    env = dict(os.environb)
    if not shutil.which("candump"):
        tools = os.fsencode(debian.unpacked("can-utils") / "usr" / "bin")
        env[b"PATH"] = env.get(b"PATH", os.fsencode(os.defpath)) + b":" + tools
    if way != "--uml":
        try:
            native.enter()
        except native.NativeUnavailableError as error:
            if way == "--native":
                raise native.NativeUnavailableError(
                    f"this kernel gives no vcan0 ({error}); as root, try: modprobe vcan && "
                    "ip link add vcan0 type vcan && ip link set vcan0 up; or use --uml"
                ) from error
        else:
            execute(argv, env)
    return uml.run(argv, env)


def _usage_error(message: str) -> int:
    print(f"tools/vcan: {message}\n{USAGE}", end="", file=sys.stderr)
    return 125
