"""A guard between controller and drive: in C for a microcontroller, and the same in Python."""
