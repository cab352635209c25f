"""What differs between campaigns, or between recorded runs, with confidence intervals."""
