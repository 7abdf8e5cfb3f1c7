"""Remaining life at varying speed by a network that learns from simulated lives, after paper 1.

records --run--> amplitudes, speeds --adaptive_twin--> trajectories --simulated_lives--> labelled snapshots
snapshots, encoding of place and speed --network, losses, training--> remaining revolutions --remaining_life--> time

Equations by number: 1 `twingap.twins.phenomenological.paper1_chain`; 5 `twingap.bearing`; 6 `losses.objective`,
`losses.descended`; 7 `losses.regression_loss`, `losses.domain_loss`; 8 `twingap.identification.equation_8`; 9 and 10
`twingap.prognosis.speed_influence`; 11 `normalised_peak_to_peak` there; 12 `degradation.damage`,
`degradation.fit_damage`; 13 `encoding.positional_encoding`; 14 `remaining_life`; 15 `losses.domain_loss`; 16
`critical_length`.
"""
