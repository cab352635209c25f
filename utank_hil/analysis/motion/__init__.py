"""Analysis of motion records: statistics, decay, exceedance, comfort and motion sickness."""
