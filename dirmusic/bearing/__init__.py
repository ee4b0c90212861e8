"""From strengths to bearings: estimators, pseudo-spectrum, posterior, and channels that are at fault."""
