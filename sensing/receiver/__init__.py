"""From what arrives to detections: front end, trigger, gates, converter, faults."""
