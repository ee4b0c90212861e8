"""Direction finding on signal strength: what would run unchanged on a real robot. It never sees truth."""

from dirmusic.bearing import Bearings, bearings_from_covariance, estimate_bearings
from dirmusic.bounds import bearing_bound, manifold_error_std
from dirmusic.calibration import Calibration, calibrate
from dirmusic.csv_table import CsvTable, InputFileError, InputFileWarning, read_csv_table
from dirmusic.element_errors import ElementErrors, ElementSpread, ManifoldPrior, UniformOffsets
from dirmusic.finding import Finding
from dirmusic.gain_delay import bearings_from_delays
from dirmusic.joint_fix import ArrayModel, PoseError
from dirmusic.locating import Locator
from dirmusic.manifold import GainManifold
from dirmusic.pattern import GainPattern, GaussianPattern, TabulatedPattern
from dirmusic.pattern_file import read_pattern, write_pattern
from dirmusic.preprocessing import Windows, band_pass, cut_windows, prepare_records, pulse_start
from dirmusic.spectrum import noise_subspace, pseudo_spectrum, pulse_spectrum, source_count, spectrum_peaks
from dirmusic.strengths import pulse_strengths, sample_covariance, strength_variance
from dirmusic.triangulation import Fix, triangulate

__all__ = [
    "ArrayModel",
    "Bearings",
    "Calibration",
    "CsvTable",
    "ElementErrors",
    "ElementSpread",
    "Finding",
    "Fix",
    "GainManifold",
    "GainPattern",
    "GaussianPattern",
    "InputFileError",
    "InputFileWarning",
    "Locator",
    "ManifoldPrior",
    "PoseError",
    "TabulatedPattern",
    "UniformOffsets",
    "Windows",
    "band_pass",
    "bearing_bound",
    "bearings_from_covariance",
    "bearings_from_delays",
    "calibrate",
    "cut_windows",
    "estimate_bearings",
    "manifold_error_std",
    "noise_subspace",
    "prepare_records",
    "pseudo_spectrum",
    "pulse_spectrum",
    "pulse_start",
    "pulse_strengths",
    "read_csv_table",
    "read_pattern",
    "sample_covariance",
    "source_count",
    "spectrum_peaks",
    "strength_variance",
    "triangulate",
    "write_pattern",
]
