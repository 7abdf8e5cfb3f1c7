"""Remaining life at varying speed by a network that learns from simulated lives, after paper 1.

records --run--> amplitudes, speeds --adaptive_twin--> trajectories --simulated_lives--> labelled snapshots
snapshots, encoding of place and speed --network, training--> remaining revolutions --run--> time

Equations by number: 1 `twingap.twins.phenomenological.paper1_chain`; 5 `twingap.bearing`; 6, 7 and 15 `training`; 8
`twingap.identification.equation_8`; 9 and 10 `twingap.prognosis.speed_influence`; 11 `normalised_peak_to_peak` there;
12 `degradation`; 13 `architecture.positional_encoding`; 14 `run.remaining_revolutions`; 16 `critical_length`.
"""
