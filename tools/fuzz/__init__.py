"""Random and mutated input, seeded: frames at the nodes, texts at the reader of configurations."""
