"""Analysis of ship, tank and law without a bus.

`loop` holds margins, robustness and trade-offs; `motion` statistics, decay, inclining test.
"""

from utank_hil.analysis.loop.loop_simulation import LoopRun as LoopRun
from utank_hil.analysis.loop.loop_simulation import SensorNoise as SensorNoise
from utank_hil.analysis.loop.loop_simulation import simulate_loop as simulate_loop
