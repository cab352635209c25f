"""Nodes and the two runners that drive them: lockstep in simulated time, and real time."""

from utank_hil.runners.bus_model import SimulatedBus as SimulatedBus
from utank_hil.runners.bus_model import frame_bits as frame_bits
from utank_hil.runners.lockstep import Lockstep as Lockstep
from utank_hil.runners.node import Node as Node
from utank_hil.runners.node import NodeError as NodeError
from utank_hil.runners.node import heard_by as heard_by
from utank_hil.runners.process_priority import real_time_scheduling as real_time_scheduling
from utank_hil.runners.realtime import MonotonicClock as MonotonicClock
from utank_hil.runners.realtime import RealTimeLoop as RealTimeLoop
from utank_hil.runners.statistics import Histogram as Histogram
from utank_hil.runners.statistics import LoopStatistics as LoopStatistics
from utank_hil.runners.stopping import stop_on_signals as stop_on_signals
