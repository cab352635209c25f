"""What a wheel has and a checkout has not: the commit that it was built from, as a file."""

import subprocess
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py


class BuildWithCommit(build_py):
    """Copies the packages and writes ``utank_hil/commit.txt`` beside them."""

    def run(self) -> None:
        """Build as setuptools does, then note the commit, where there is one."""
        super().run()
        folder = Path(__file__).parent
        if self.editable_mode or not (folder / ".git").exists():
            return
        words = ["git", "describe", "--always", "--abbrev=12", "--dirty"]
        try:
            described = subprocess.run(
                words, cwd=folder, capture_output=True, text=True, check=True
            ).stdout
        except (OSError, subprocess.CalledProcessError) as error:
            print(f"the wheel will name no commit: {error}")
            return
        Path(self.build_lib, "utank_hil", "commit.txt").write_text(described, encoding="utf-8")


setup(cmdclass={"build_py": BuildWithCommit})
