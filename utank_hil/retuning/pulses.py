"""The pulses that an identification gives, made once before the loop begins."""

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.control import ARX, DesignPlant, PumpLimits
from utank_hil.retuning.settings import RetuningSettings


def make_pulses(settings: RetuningSettings, plant: DesignPlant, sample_time_s: float) -> FloatArray:
    """Pulses of the chosen kind within pressure and rate, and within roll and level on this ship.

    Roll and level are those that the pulses alone cause in still water. The level limit
    applies to the sum of waves, law and pulses, at every command; this is only its first guard.

    Returns
    -------
    ndarray, shape (N,)
        Pressure in Pa.

    Raises
    ------
    ValueError
        If the signal does not fit the sample time, such as a band beyond its Nyquist frequency.
    """
    # scipy.optimize: not for every start
    from utank_hil.identification import chirp, multisine, prbs, random_pulses, response_scale

    limits = plant.limits
    within = PumpLimits(
        pressure_pa=min(settings.pulse_pa, limits.pressure_pa), rate_pa_s=limits.rate_pa_s
    )
    how_long_s, seed = settings.identification_s, settings.seed
    match settings.excitation.kind:
        case "random_pulses":
            pulses = random_pulses(how_long_s, within, seed, settings.pulse_hold_s, sample_time_s)
        case "prbs":
            pulses = prbs(how_long_s, within, seed, settings.pulse_hold_s[0], sample_time_s)
        case "multisine":
            pulses = multisine(how_long_s, within, seed, settings.excitation.band, sample_time_s)
        case "chirp":
            pulses = chirp(how_long_s, within, settings.excitation.band, sample_time_s)
    sampled = plant.sampled(("roll_rad", "level_m"), sample_time_s)
    model = ARX.from_state_space(sampled, len(sampled.A))
    room = np.array([settings.added_roll_rad, limits.level_m])
    return pulses * response_scale(pulses, model, room)
