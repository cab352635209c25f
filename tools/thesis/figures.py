"""The figures of the source for the evidence: `utank-hil reproduce` as a module.

python -m tools.thesis.figures --json           # as utank-hil reproduce
"""

from utank_hil.commands.common import new_app
from utank_hil.commands.reproduce import reproduce

if __name__ == "__main__":
    application = new_app()
    application.command()(reproduce)
    application()
