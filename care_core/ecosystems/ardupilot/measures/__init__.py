"""ArduPilot flights and drives: how missions are found in a DataFlash log, and the extractors that read them."""
