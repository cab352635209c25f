"""Settings of all tests."""

import os

# what is tested can be patched and is covered
os.environ.setdefault("UTANK_HIL_COMPILED", "0")

from hypothesis import settings

import utank_hil.commands.single_thread  # noqa: F401, as the commands do, before numpy loads

# machines are shared: an example that takes long says nothing about the code
settings.register_profile("search", deadline=None, print_blob=True)
# the same examples each time: what lands is not left to chance; `make search` draws new ones
settings.register_profile("same", settings.get_profile("search"), derandomize=True)
settings.register_profile("few", settings.get_profile("same"), max_examples=10)  # make test-fast
settings.load_profile("same")
