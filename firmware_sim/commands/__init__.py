"""Commands that drive a bench; they join the command line by entry points."""
