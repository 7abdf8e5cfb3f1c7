"""Features of tones in raw and envelope spectra."""
