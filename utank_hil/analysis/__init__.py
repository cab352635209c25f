"""Analysis: what a ship, a tank and a law do, without a bus.

The rooms: `loop` (margins, robustness, bounds, trade-offs), `motion` (statistics, decay, comfort,
exceedance) and `capsize`.
"""
