"""Sources of pulses and interference, and their waveforms."""
