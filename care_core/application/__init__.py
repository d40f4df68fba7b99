"""What the command line, the app and scripts have in common. Above all rooms; `api` is its public face."""
