"""Image files with known truth, whose surface, optics and detector are not those of the corrections: `planetpose
simulate`."""
