"""Logs of a CAN bus in the formats of other programs.

python-can reads MF4 and writes BLF. Its other readers are not used: they never end at a BLF object
without size, and drop lines, lengths and classes without a word.
"""
