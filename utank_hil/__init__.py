"""Hardware-in-the-loop controller stack for active U-tube anti-roll tanks."""

from utank_hil.base.compiled import use_if_current

use_if_current()
