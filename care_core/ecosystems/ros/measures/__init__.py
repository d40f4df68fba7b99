"""Measures of ROS recordings."""
