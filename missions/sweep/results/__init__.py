"""What sweeps came to: summaries with intervals, tables, pictures, and paired comparisons."""
