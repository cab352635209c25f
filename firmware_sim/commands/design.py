"""``utank-hil design``: candidate laws and tanks, with their costs."""

from firmware_sim.commands.design_controller import controller
from firmware_sim.commands.design_tank import tank
from utank_hil.console.common import new_app

design = new_app("Design a law or a tank: what it could be, and what it would cost.")
design.command()(controller)
design.command()(tank)
