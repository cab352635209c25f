"""What every package may use: arrays, parameters of laws, the tick, files, provenance."""
