"""Waves that bend: what edges, alone and in pairs, leave of a wave, and all rays round boxes."""
