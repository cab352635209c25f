"""A record of motion: statistics, decay, exceedance, and what people on board have of it."""
