"""Predictive laws of fixed gains: GPC and DPC."""
