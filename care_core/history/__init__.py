"""The local store of past triages and verifications, and what it tells of kept promises."""
