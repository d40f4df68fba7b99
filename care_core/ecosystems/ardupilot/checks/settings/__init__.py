"""Health checks by which a run itself shows that a parameter is wrong, and where it can what its value should be."""
