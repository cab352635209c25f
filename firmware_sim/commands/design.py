"""``utank-hil design``: what a law or a tank could be, and what it would cost."""

from firmware_sim.commands.design_controller import controller
from firmware_sim.commands.design_tank import tank
from utank_hil.console.common import new_app

design = new_app("Design a law or a tank: what it could be, and what it would cost.")
design.command()(controller)
design.command()(tank)
