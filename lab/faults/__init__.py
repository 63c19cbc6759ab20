"""How a reprocessing run stands kills, a full disk, a lost server, company: `planetpose benchmark faults`."""
