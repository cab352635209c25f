"""Commissioning at the quay: small pump pulses show that every sensor and the pump are as written.

The pulses are a plan: no measurement steers the pump, so a sensor with the wrong sign can't feed
back. The controller node and its supervisor run as always.
"""
