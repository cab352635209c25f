"""Waves: model and measured spectra, irregular seas, roll moment."""

from utank_hil.sea.encounter import encounter_frequency, wave_frequencies
from utank_hil.sea.harmonics import Harmonics
from utank_hil.sea.measured import MeasuredSpectra
from utank_hil.sea.models import ittc, jonswap, pierson_moskowitz
from utank_hil.sea.ndbc import load_ndbc
from utank_hil.sea.sea import EffectiveSlope, Sea
from utank_hil.sea.slope_spectrum import SlopeSpectrum
from utank_hil.sea.spectrum import Spectrum

__all__ = [
    "EffectiveSlope",
    "Harmonics",
    "MeasuredSpectra",
    "Sea",
    "SlopeSpectrum",
    "Spectrum",
    "encounter_frequency",
    "ittc",
    "jonswap",
    "load_ndbc",
    "pierson_moskowitz",
    "wave_frequencies",
]
