"""What a receiver samples, in compiled loops: signals, carriers and noise in all channels, the trigger, the gate."""
