"""Sources of discharge pulses and interference, and their waveforms."""
