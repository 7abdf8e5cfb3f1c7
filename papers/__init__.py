"""The three papers and studies of this project's own: `framework` runs a study, `reproduce` the studies of a paper."""
