"""Campaigns: many cases of a scenario, on all cores or a cluster, their results kept as Parquet."""
