"""What takes too long for `make test`: run once, kept as data in ``docs/evidence``.

`parts.py` lists what is run, `record.py` says what a result holds and when it is out of date,
`pytest_part.py` runs tests as a part.
"""
