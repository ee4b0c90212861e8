"""What makes each exhibit: trials by the paper's method and by the best one."""
