"""Export of missions to the formats of other tools: CSV, GeoJSON, Parquet and MCAP (ROS 2)."""
