"""The frames that the nodes send, against the worst case that the catalogue's page states."""

import re
from pathlib import Path

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from utank_hil.assembly import build_controller_node
from utank_hil.configuration import load_config
from utank_hil.runners import Lockstep, SimulatedBus

PAGE = Path("docs/can-catalogue.md")
ESTIMATES = 2  #: Frames a second of a controller that estimates sea and ship, as this one does not.


def test_the_stated_load_covers_every_message_that_the_four_nodes_send():
    scenario = load_config(Path("configs/scenarios/storm.yaml"), Scenario)
    ship = build_ship_side(scenario, 1, scenario.operator)
    bus = SimulatedBus(bit_rate=250_000)
    run = Lockstep([*ship.nodes, build_controller_node(scenario.controllers["gpc"])], bus)
    run.run_until(1_000_000_000)
    before = bus.frames
    run.run_until(3_000_000_000)
    frames_a_second = (bus.frames - before) / 2

    row = r"\| controller, drive, sensors, panel \| (\d+) \| ([\d.]+)% \|"
    stated, load_percent = re.search(row, PAGE.read_text(encoding="utf-8")).groups()
    assert abs(frames_a_second + ESTIMATES - int(stated)) <= 1
    assert bus.load(run.now_ns) <= float(load_percent) / 100
