"""A simulated robot for Nav2: world, body on wheels, laser and battery, driven by a real Nav2, and its recording.

Only `node` and `servers` need ROS 2; the rest runs anywhere.
"""
