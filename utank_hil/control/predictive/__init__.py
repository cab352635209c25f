"""Predictive laws with constant gains: GPC and DPC."""
