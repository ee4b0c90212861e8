"""Which pulse belongs to which finding: record of pulses, gating, ghost test, decision."""
