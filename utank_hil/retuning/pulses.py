"""The excitation of an identification, computed once before the loop begins."""

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control import ARX, DesignPlant, PumpLimits
from utank_hil.retuning.settings import RetuningSettings


def make_pulses(settings: RetuningSettings, plant: DesignPlant, sample_time_s: float) -> FloatArray:
    """Return the excitation pressure in Pa, shape (N,), within all limits of pump, roll and level.

    Roll and level are predicted for the pulses alone, in still water on the given plant. In service
    the limiter applies the level limit to the sum of waves, law and pulses. A ValueError is raised
    if the signal does not fit the sample time, such as a band beyond its Nyquist frequency.
    """
    # scipy.optimize is slow to import and needed with retuning only
    from utank_hil.identification import chirp, multisine, prbs, random_pulses, response_scale

    limits = plant.limits
    bounds = PumpLimits(
        pressure_pa=min(settings.pulse_pa, limits.pressure_pa), rate_pa_s=limits.rate_pa_s
    )
    duration_s, seed = settings.identification_s, settings.seed
    match settings.excitation.kind:
        case "random_pulses":
            pulses = random_pulses(
                duration_s, bounds, seed, settings.pulse_hold_s, sample_time_s=sample_time_s
            )
        case "prbs":
            clock_s = settings.pulse_hold_s[0]
            pulses = prbs(duration_s, bounds, seed, clock_s, sample_time_s=sample_time_s)
        case "multisine":
            band = settings.excitation.band
            pulses = multisine(duration_s, bounds, seed, band, sample_time_s=sample_time_s)
        case "chirp":
            band = settings.excitation.band
            pulses = chirp(duration_s, bounds, band, sample_time_s=sample_time_s)
    sampled = plant.sampled(("roll_rad", "level_m"), sample_time_s)
    model = ARX.from_state_space(sampled, len(sampled.A))
    response_limits = np.array([settings.added_roll_rad, limits.level_m])
    return pulses * response_scale(pulses, model, response_limits)
