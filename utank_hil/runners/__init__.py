"""Nodes and the two runners that drive them: lockstep in simulated time, and real time."""

from utank_hil.runners.bus_model import BusStatistics, SimulatedBus
from utank_hil.runners.clock import Clock, MonotonicClock
from utank_hil.runners.errors import NodeError
from utank_hil.runners.hooks import LinkObserver, Stoppable
from utank_hil.runners.lockstep import Lockstep
from utank_hil.runners.node import Node, heard_by
from utank_hil.runners.process_priority import SchedulingReport, real_time_scheduling
from utank_hil.runners.realtime import RealTimeLoop
from utank_hil.runners.statistics import Histogram, LoopStatistics
from utank_hil.runners.stopping import stop_on_signals
from utank_hil.runners.wire_time import frame_bits

__all__ = [
    "BusStatistics",
    "Clock",
    "Histogram",
    "LinkObserver",
    "Lockstep",
    "LoopStatistics",
    "MonotonicClock",
    "Node",
    "NodeError",
    "RealTimeLoop",
    "SchedulingReport",
    "SimulatedBus",
    "Stoppable",
    "frame_bits",
    "heard_by",
    "real_time_scheduling",
    "stop_on_signals",
]
