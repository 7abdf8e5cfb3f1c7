"""Features of the converter and the amplitude distribution."""
