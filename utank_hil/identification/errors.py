"""Exception of the identification."""


class IdentificationError(ValueError):
    """The record does not determine a model; the message says why and what would help."""
