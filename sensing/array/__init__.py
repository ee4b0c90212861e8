"""The array of antennas as nature has it: its settings, one array as built, and many as compiled loops read them."""
