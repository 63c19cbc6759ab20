"""How right corrections are: simulated archives, corrected and compared with the truth: `planetpose evaluate`."""
