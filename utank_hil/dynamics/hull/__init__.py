"""Hydrodynamic data of a hull and what follows from them."""
