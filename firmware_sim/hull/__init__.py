"""Hulls of the bench: from a mesh or main particulars to hydrodynamic data, by Capytaine."""
