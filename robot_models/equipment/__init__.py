"""Equipment of substations: shapes and colours by kind."""
