"""What every command line shares: options, terminal, errors and their exit codes."""
