"""From what the channels recorded to pulses: preprocessing, strengths, and kinds of discharge."""
