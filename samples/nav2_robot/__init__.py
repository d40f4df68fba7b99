"""A simulated robot for Nav2: world, body on wheels, laser, battery, what fails on the way, and its recording."""
