"""Analysis: what a ship, a tank and a law do, without a bus.

The rooms: `loop` (margins, robustness, trade-offs) and `motion` (statistics, decay, comfort,
exceedance).
"""
