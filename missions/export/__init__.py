"""A mission in the formats of other tools: CSV and GeoJSON of findings, Parquet of steps and pulses, MCAP for ROS 2."""
