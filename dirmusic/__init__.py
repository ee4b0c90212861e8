"""Direction finding on signal strength: what would run unchanged on a real robot. It never sees truth."""

from dirmusic.bearing import Bearings, bearings_from_covariance, estimate_bearings
from dirmusic.bounds import bearing_bound, manifold_error_std
from dirmusic.element_errors import ElementErrors, ElementSpread, ManifoldPrior, UniformOffsets
from dirmusic.joint_fix import ArrayModel, PoseError
from dirmusic.locating import Finding, Locator
from dirmusic.manifold import GainManifold
from dirmusic.pattern import GainPattern, GaussianPattern, TabulatedPattern
from dirmusic.spectrum import noise_subspace, pseudo_spectrum
from dirmusic.strengths import pulse_strengths, sample_covariance, strength_variance
from dirmusic.triangulation import Fix, triangulate

__all__ = [
    "ArrayModel",
    "Bearings",
    "ElementErrors",
    "ElementSpread",
    "Finding",
    "Fix",
    "GainManifold",
    "GainPattern",
    "GaussianPattern",
    "Locator",
    "ManifoldPrior",
    "PoseError",
    "TabulatedPattern",
    "UniformOffsets",
    "bearing_bound",
    "bearings_from_covariance",
    "estimate_bearings",
    "manifold_error_std",
    "noise_subspace",
    "pseudo_spectrum",
    "pulse_strengths",
    "sample_covariance",
    "strength_variance",
    "triangulate",
]
