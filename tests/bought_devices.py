"""Sections of devices of other makers, as ships' files have them."""

SBG = {"profile": "sbg_ellipse", "bus": "can1", "accept_unprotected": True}
LEVELS = {
    "profile": "cia404_levels", "bus": "can2", "node": 7, "high_level_m": 4.6,
    "accept_unprotected": True,
    "signals": {name: {"scale": 0.65, "offset": -7.8} for name in
                ("port_level_m", "starboard_level_m")},
}  # fmt: skip
