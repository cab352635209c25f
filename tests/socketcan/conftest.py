"""Say at the end when a test on the emulated kernel had to be tried again."""

from busy_machine import RETRIED


def pytest_terminal_summary(terminalreporter):
    for line in RETRIED:
        terminalreporter.write_line(f"machine too busy to judge, {line}")
