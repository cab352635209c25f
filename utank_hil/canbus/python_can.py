"""python-can without asammdf, which it imports where that is installed, and pandas with it.

No reader of measurements belongs in the controller's process. cantools imports python-can, too: so
this comes first.
"""

import sys
from types import ModuleType
from typing import cast

if "asammdf" in sys.modules:
    import can
    from can.interfaces.socketcan import SocketcanBus
else:
    sys.modules["asammdf"] = cast(ModuleType, None)  # a module that can't be imported
    try:
        import can
        from can.interfaces.socketcan import SocketcanBus
    finally:
        del sys.modules["asammdf"]

__all__ = ["SocketcanBus", "can"]
