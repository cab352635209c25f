"""Waves: model and measured spectra, irregular seas, roll moment."""

from utank_hil.sea.harmonics import Harmonics as Harmonics
from utank_hil.sea.measured import MeasuredSpectra as MeasuredSpectra
from utank_hil.sea.ndbc import load_ndbc as load_ndbc
from utank_hil.sea.sea import EffectiveSlope as EffectiveSlope
from utank_hil.sea.sea import Sea as Sea
from utank_hil.sea.sea import encounter_frequency as encounter_frequency
from utank_hil.sea.spectrum import SlopeSpectrum as SlopeSpectrum
from utank_hil.sea.spectrum import Spectrum as Spectrum
from utank_hil.sea.spectrum import ittc as ittc
from utank_hil.sea.spectrum import jonswap as jonswap
from utank_hil.sea.spectrum import pierson_moskowitz as pierson_moskowitz
