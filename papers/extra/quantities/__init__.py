"""Study of what the network is given of each variational mode: its waveform, or its envelope spectrum."""
