"""Direction finding from signal strengths, and locating of discharges, without access to the simulated truth."""

from dirmusic.array.bounds import bearing_bound, manifold_error_std
from dirmusic.array.element_errors import ElementErrors, ElementSpread, ManifoldPrior, UniformOffsets
from dirmusic.array.manifold import GainManifold
from dirmusic.array.model import ArrayModel
from dirmusic.array.pattern import GainPattern, GaussianPattern, TabulatedPattern
from dirmusic.array.pattern_file import read_pattern
from dirmusic.bearing.elevation import total_std
from dirmusic.bearing.estimators import ESTIMATORS, BearingEstimator
from dirmusic.bearing.maximum_likelihood import bearings_from_covariance, bearings_towards, estimate_bearings
from dirmusic.bearing.spectrum import noise_subspace, pseudo_spectrum, pulse_spectrum, source_count, spectrum_peaks
from dirmusic.frame import FrameEstimate
from dirmusic.input_file import InputFileError, InputFileWarning
from dirmusic.locating.bearing_fit import PositionEstimate, triangulate
from dirmusic.locating.finding import Finding
from dirmusic.locating.locator import Locator
from dirmusic.locating.protocol import PoseError
from dirmusic.locating.yard_likelihood import Grid, YardLikelihood
from dirmusic.pulses.batch import Bearings, PulseBatch
from dirmusic.pulses.strengths import cut_windows, pulse_start, pulse_strengths, sample_covariance, strength_variance

__all__ = [
    "ESTIMATORS",
    "ArrayModel",
    "BearingEstimator",
    "Bearings",
    "ElementErrors",
    "ElementSpread",
    "Finding",
    "FrameEstimate",
    "GainManifold",
    "GainPattern",
    "GaussianPattern",
    "Grid",
    "InputFileError",
    "InputFileWarning",
    "Locator",
    "ManifoldPrior",
    "PoseError",
    "PositionEstimate",
    "PulseBatch",
    "TabulatedPattern",
    "UniformOffsets",
    "YardLikelihood",
    "bearing_bound",
    "bearings_from_covariance",
    "bearings_towards",
    "cut_windows",
    "estimate_bearings",
    "manifold_error_std",
    "noise_subspace",
    "pseudo_spectrum",
    "pulse_spectrum",
    "pulse_start",
    "pulse_strengths",
    "read_pattern",
    "sample_covariance",
    "source_count",
    "spectrum_peaks",
    "strength_variance",
    "total_std",
    "triangulate",
]
