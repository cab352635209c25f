"""What ``tools/vcan`` does: run any command with a working ``vcan0``, without root.

``cli`` chooses; ``native`` uses the running kernel; ``uml`` boots a user-mode Linux kernel, whose
first process is ``guest``; ``debian`` fetches the packages; ``linux`` holds the system calls.
Standard library only: it runs before the project's virtual environment exists.
"""
