"""Gap report: where a recording and a simulation of the same drive differ."""
