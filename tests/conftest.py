"""Settings of all tests."""

from hypothesis import settings

import utank_hil.commands.single_thread  # noqa: F401, as the commands do, before numpy loads

# machines are shared: an example that takes long says nothing about the code
settings.register_profile("shared", deadline=None, print_blob=True)
settings.load_profile("shared")
