"""Where the robot is by its own wheels and gyro alone: path from the encoders, heading from the gyro. It drifts."""

from __future__ import annotations

from pydantic import BaseModel, NonNegativeFloat


class OdometryConfig(BaseModel, frozen=True, strict=True, extra="forbid", allow_inf_nan=False):
    """Standard deviations of what makes odometry drift; defaults assumed, as of magnetic encoders and a MEMS gyro."""

    wheel_radius_error: NonNegativeFloat = 0.001
    """Share by which the wheels are larger or smaller than the robot believes, drawn once."""
    gyro_bias_deg_per_min: NonNegativeFloat = 0.05
    """Drawn once: what is left after the gyro was zeroed at the dock."""
    gyro_noise_deg_per_sqrt_min: NonNegativeFloat = 0.1
    """Angle random walk."""
