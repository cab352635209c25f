"""Default predictive designs, chosen for the thesis's first ship in a storm; see docs/control.md.

Both were found by minimizing the roll of the first ship (0.5 rad/s, 2.5 % damping) in the hour of
NDBC 41010, 2019-02-10 05:40, behind 50 ms of delay, 0.1 s of lag and default `PumpLimits`, while
peak sensitivity stays below 1.75 and the loop stable over +-30 % of roll period, 0.8 to 1.25 of
inertia and +-20 % of gain.
"""

from typing import Final

from utank_hil.control.predictive.design import PredictiveDesign, Predictor

GPC_ROLL: Final = PredictiveDesign(
    kind="gpc",
    predictor=Predictor(
        measured=("roll_rad",),
        measurement_std=(4.2e-3,),
        order=90,
        wave_peak_rad_s=0.648,
        wave_damping_ratio=0.0117,
        wave_slope_rad=0.054,
        pressure_noise_pa_rt_s=2070.0,
    ),
    control_horizon=58,
    prediction_horizon=71,
    output_weight=(1.23e12,),
    first_output=28,
    washout_rad_s=0.02,
)

DPC_ROLL_LEVEL: Final = PredictiveDesign(
    kind="dpc",
    predictor=Predictor(
        measured=("roll_rad", "level_m"),
        measurement_std=(2.1e-3, 0.049),
        order=90,
        wave_peak_rad_s=0.604,
        wave_damping_ratio=0.0178,
        wave_slope_rad=0.054,
        pressure_noise_pa_rt_s=620.0,
    ),
    control_horizon=57,
    prediction_horizon=71,
    output_weight=(1.34e12, 2.1e7),
    washout_rad_s=0.02,
)
