"""Analysis of motion records: statistics, decay, inclining test."""
