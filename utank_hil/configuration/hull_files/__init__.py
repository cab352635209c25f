"""Readers of hull data, as seakeeping codes write them."""
