"""Nodes and the two runners that drive them: lockstep in simulated time, and real time."""

from utank_hil.runtime.bus_model import BusStatistics, SimulatedBus
from utank_hil.runtime.clock import Clock, MonotonicClock
from utank_hil.runtime.errors import NodeError
from utank_hil.runtime.hooks import LinkObserver, Stoppable
from utank_hil.runtime.lockstep import Lockstep
from utank_hil.runtime.node import Node, heard_by
from utank_hil.runtime.process_priority import SchedulingReport, real_time_scheduling
from utank_hil.runtime.realtime import RealTimeLoop
from utank_hil.runtime.statistics import Histogram, LoopStatistics
from utank_hil.runtime.stopping import stop_on_signals
from utank_hil.runtime.wire_time import frame_bits

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
