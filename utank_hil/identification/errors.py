"""What identification raises when a record cannot be made into a model."""


class IdentificationError(ValueError):
    """The record does not determine a model; the message says why and what would help."""
