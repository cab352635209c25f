"""Devices of other makers on the bus: layouts of their frames, and what is made of these."""
