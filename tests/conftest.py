"""Settings of all tests."""

from hypothesis import settings

# machines are shared: an example that takes long says nothing about the code
settings.register_profile("shared", deadline=None, print_blob=True)
settings.load_profile("shared")
