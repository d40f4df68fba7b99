"""What is known of each ecosystem that writes logs: ArduPilot, PX4 and ROS. Needs no profile."""
