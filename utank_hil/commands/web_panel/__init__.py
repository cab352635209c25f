"""The operator's panel as a page in a browser: ``utank-hil panel --web``."""
