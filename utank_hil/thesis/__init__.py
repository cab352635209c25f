"""The figures and printed numbers of the source thesis, made anew from this project's models."""
