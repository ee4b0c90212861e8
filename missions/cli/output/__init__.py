"""What a command writes: lines on a terminal, folders on disk."""
