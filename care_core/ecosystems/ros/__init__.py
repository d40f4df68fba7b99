"""ROS recordings: what happened, and what was not as it should be. Topics are told by their message type."""
