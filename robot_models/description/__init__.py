"""What a robot is: read from its MJCF file, checked and measured."""
