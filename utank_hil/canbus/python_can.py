"""python-can without asammdf, which it imports where that is installed, and pandas with it.

No reader of measurements belongs in the controller's process.
"""

import sys
from types import ModuleType
from typing import Final, cast

_ABSENT: Final = cast(ModuleType, None)  #: Entry of a module that can't be imported.

if "asammdf" in sys.modules:
    import can
    from can.interfaces.socketcan import SocketcanBus
else:
    sys.modules["asammdf"] = _ABSENT
    try:
        import can
        from can.interfaces.socketcan import SocketcanBus
    finally:
        del sys.modules["asammdf"]

__all__ = ["SocketcanBus", "can"]
